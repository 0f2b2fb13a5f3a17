"""Hosts of a network: Linux network namespaces with links that can be cut."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import count

_COUNT = count()
_SWITCH = "switch"


class CannotMakeHostsError(Exception):
    """This machine has no `ip`, or this process may not make namespaces."""


class NetworkHosts:
    """Hosts by name, each with an address, at one switch; this process reaches them all.

    The switch is a bridge in a namespace of its own, which this machine's firewall does not filter.
    """

    def __init__(self, names: Sequence[str], number: int) -> None:
        self._id = f"{os.getpid() % 1_000_000:06d}{number % 10}"
        self._net = f"10.{87 + number % 40}.{os.getpid() % 250}"
        self.addresses = {name: f"{self._net}.{index + 2}" for index, name in enumerate(names)}
        self._links = {name: f"v{self._id}{index}" for index, name in enumerate(names)}

    def _namespace(self, name: str) -> str:
        return f"myview-{self._id}-{name}"

    def within(self, name: str) -> list[str]:
        """Return the words that run a command on a host."""
        return ["ip", "netns", "exec", self._namespace(name)]

    def make(self, stack: ExitStack) -> None:
        """Make the switch and the hosts; they are removed by `stack`."""
        switch, uplink = self._namespace(_SWITCH), f"u{self._id}"
        for name in (_SWITCH, *self.addresses):
            _ip("netns", "add", self._namespace(name))
            stack.callback(_quietly, "netns", "del", self._namespace(name))
        _ip("-n", switch, "link", "add", "bridge", "type", "bridge")
        _ip("-n", switch, "link", "set", "bridge", "up")
        _ip("link", "add", uplink, "type", "veth", "peer", "name", uplink, "netns", switch)
        stack.callback(_quietly, "link", "del", uplink)
        _ip("-n", switch, "link", "set", uplink, "master", "bridge", "up")
        _ip("addr", "add", f"{self._net}.1/24", "dev", uplink)
        _ip("link", "set", uplink, "up")
        for name, address in self.addresses.items():
            space, link = self._namespace(name), self._links[name]
            _ip("-n", switch, "link", "add", link, "type", "veth", "peer", "name", "eth0", "netns", space)
            _ip("-n", switch, "link", "set", link, "master", "bridge", "up")
            _ip("-n", space, "link", "set", "lo", "up")
            _ip("-n", space, "addr", "add", f"{address}/24", "dev", "eth0")
            _ip("-n", space, "link", "set", "eth0", "up")

    def cut(self, name: str, *, is_cut: bool = True) -> None:
        """Cut a host off, without closing any connection, or connect it again."""
        _ip("-n", self._namespace(_SWITCH), "link", "set", self._links[name], "down" if is_cut else "up")


@contextmanager
def network_hosts(*names: str) -> Iterator[NetworkHosts]:
    """Make hosts, and remove them at the end.

    Raises:
        CannotMakeHostsError: they cannot be made here.
    """
    if shutil.which("ip") is None:
        raise CannotMakeHostsError("there is no program ip (Debian: iproute2)")
    hosts = NetworkHosts(names, next(_COUNT))
    with ExitStack() as stack:
        try:
            hosts.make(stack)
        except subprocess.CalledProcessError as error:
            raise CannotMakeHostsError(f"{' '.join(error.cmd)}: {error.stderr.strip()}") from error
        yield hosts


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)


def _quietly(*words: str) -> None:
    subprocess.run(["ip", *words], check=False, capture_output=True)
