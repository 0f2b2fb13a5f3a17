"""A site with two best-view services behind one address; each process may have a host of its own."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import shutil
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import aiohttp

from benchmarks.common.environment import ROOT, CannotRunError
from benchmarks.common.network_hosts import CannotMakeHostsError, NetworkHosts, network_hosts
from benchmarks.common.process_load import children_of
from benchmarks.faults.injection.separate_processes import SeparateProcesses, write_config
from benchmarks.faults.site.fault_site import SETTINGS, FaultSite, follow_events
from benchmarks.faults.video.stamped_views import CAMERAS, StampedViews
from server.cli.generated_config import free_port

SERVICES = ("bestview-0", "bestview-1")
NAMES = (*SERVICES, "sync", *CAMERAS)
JOINT = "joint tracker"
_JOINT_MODULE = "server.service.joint_tracking"
_LEADS = re.compile(r"^myview_leads 1\.0$", re.MULTILINE)
_ANSWER_S, _LEADS_S, _POLL_S = 5.0, 10.0, 0.2
_START_S = 180.0
_BUS_PORT, _HTTP_PORT, _SYNC_PORT = 7447, 8080, 7400


@dataclass(slots=True)
class SiteOfServices:
    """A running site with two services.

    Attributes:
        services: the services' sites as their viewers see them: addresses and events.
        front: the one address of both services; empty: there is none.
    """

    services: tuple[FaultSite, ...]
    front: str

    def pid(self, name: str) -> int:
        """Return a process's id; 0 where a container has it.

        Raises:
            RuntimeError: it does not run.
        """
        raise NotImplementedError

    def joint_tracker(self, service: str) -> int:
        """Return the id of a service's process that tracks jointly.

        Raises:
            RuntimeError: there is none.
        """
        raise NotImplementedError

    async def leader(self) -> int:
        """Return the index of the leading service, by the services' metrics.

        Raises:
            RuntimeError: not exactly one leads for some time.
        """
        timeout = aiohttp.ClientTimeout(total=_ANSWER_S)
        deadline = time.monotonic() + _LEADS_S
        async with aiohttp.ClientSession(timeout=timeout, raise_for_status=True) as session:
            while True:
                texts = [await _text(session, f"{site.url}metrics") for site in self.services]
                leading = [index for index, text in enumerate(texts) if _LEADS.search(text)]
                if len(leading) == 1:
                    return leading[0]
                if time.monotonic() > deadline:
                    raise RuntimeError(f"services that lead: {leading}")
                await asyncio.sleep(_POLL_S)

    async def settle(self) -> None:
        """Wait until both services are healthy.

        Raises:
            RuntimeError: they do not become so in time.
        """
        await asyncio.gather(*(site.settle() for site in self.services))


@dataclass(slots=True)
class TwoServices(SiteOfServices):
    """A site whose processes this one has started.

    Attributes:
        processes: by name, of NAMES.
        hosts: of the processes; None: all run on this machine, and none can be cut off.
    """

    processes: SeparateProcesses
    hosts: NetworkHosts | None

    def pid(self, name: str) -> int:
        """Return a process's id.

        Raises:
            RuntimeError: it does not run.
        """
        process = self.processes.processes[name]
        if process.returncode is not None:
            raise RuntimeError(f"there is no process {name}")
        return process.pid

    def joint_tracker(self, service: str) -> int:
        """Return the id of a service's process that tracks jointly.

        Raises:
            RuntimeError: there is none.
        """
        found = children_of(self.pid(service), _JOINT_MODULE)
        if not found:
            raise RuntimeError(f"{service} has no process that tracks jointly")
        return found[0]


async def _text(session: aiohttp.ClientSession, url: str) -> str:
    async with session.get(url) as answer:
        return await answer.text()


@contextlib.contextmanager
def _hosts(*, cut_off: bool) -> Iterator[NetworkHosts | None]:
    """Make a host for each process, where they can be made; none unless one of them is to be cut off."""
    if not cut_off:
        yield None
        return
    with network_hosts(*NAMES) as hosts:
        yield hosts


@contextlib.asynccontextmanager
async def run_two_services(
    views: StampedViews, folder: Path, *, cut_off: bool, joint: bool
) -> AsyncIterator[TwoServices]:
    """Run the site; terminate it at the end.

    Raises:
        CannotRunError: processes are to be cut off, and there can be no hosts.
        RuntimeError: it does not become healthy.
    """
    async with contextlib.AsyncExitStack() as stack:
        try:
            hosts = stack.enter_context(_hosts(cut_off=cut_off))
        except CannotMakeHostsError as error:
            raise CannotRunError(f"needs network namespaces: {error}") from None
        at = {name: "127.0.0.1" if hosts is None else hosts.addresses[name] for name in NAMES}
        ports = [free_port() if hosts is None else _HTTP_PORT for _ in SERVICES]
        routers = [f"tcp/{at[name]}:{free_port() if hosts is None else _BUS_PORT}" for name in SERVICES]
        addresses = [f"{at[name]}:{port}" for name, port in zip(SERVICES, ports, strict=True)]
        urls = [f"http://{address}/" for address in addresses]
        settings: dict[str, dict[str, Any]] = {
            "zenoh": {"connect": routers, "listen": routers[0]},
            "view": {"sharding": {"servers": urls}},
            "track": {"joint": joint},
            "access": {"open_to_all": True, "trusted_network": True},
        }
        if hosts is not None:
            own = {"host": at["sync"], "bind": at["sync"], "port": _SYNC_PORT}
            settings["sync"] = {**SETTINGS["sync"], **own}
        environments = {
            name: {
                "MYVIEW_VIEW__SHARDING__INDEX": str(index),
                "MYVIEW_ZENOH__LISTEN": routers[index],
                "MYVIEW_HTTP__HOST": at[name],
                "MYVIEW_HTTP__PORT": str(ports[index]),
                "MYVIEW_RECORD__FOLDER": str(folder / f"kept-{index}"),
            }
            for index, name in enumerate(SERVICES)
        }
        prefixes = {} if hosts is None else {name: hosts.within(name) for name in NAMES}
        config, _ = write_config(views, folder, settings)
        log = stack.enter_context((folder / "site.log").open("w", encoding="utf-8"))
        processes = SeparateProcesses(config, log, environments, prefixes)
        stack.push_async_callback(processes.terminate)
        front = await stack.enter_async_context(_front(addresses, folder))
        for name in NAMES:
            await processes.start(name)
        sites = [
            FaultSite(url, folder, 0, recorded=folder / f"kept-{index}") for index, url in enumerate(urls)
        ]
        async with follow_events(sites[0], _START_S), follow_events(sites[1], _START_S):
            yield TwoServices(tuple(sites), front, processes, hosts)


@contextlib.asynccontextmanager
async def _front(addresses: Sequence[str], folder: Path) -> AsyncIterator[str]:
    """Run HAProxy by configs/haproxy.cfg; yield its address, empty where there is no HAProxy."""
    program = shutil.which("haproxy") or shutil.which("haproxy", path="/usr/sbin")
    if program is None:
        yield ""
        return
    address = f"127.0.0.1:{free_port()}"
    variables = {f"MYVIEW_SERVICE_{index}": service for index, service in enumerate(addresses)}
    with (folder / "haproxy.log").open("w", encoding="utf-8") as log:
        process = await asyncio.create_subprocess_exec(
            *(program, "-db", "-f", str(ROOT / "configs" / "haproxy.cfg")),
            env={**os.environ, **variables, "MYVIEW_FRONT": address},
            stdout=log,
            stderr=log,
        )
        try:
            yield f"http://{address}/"
        finally:
            with contextlib.suppress(ProcessLookupError):
                process.terminate()
            await process.wait()
