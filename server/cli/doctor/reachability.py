"""Reachability checks: whether pulse server and bus answer at the addresses that cameras use."""

from __future__ import annotations

import asyncio
import os
import socket

from server.cli.doctor.findings import Finding, bad, ok, report_failure, warning
from server.config.site_config import Config
from server.system.errors import reason_of

_ANSWER_S = 3.0
_ANYWHERE = frozenset({"0.0.0.0", "::"})  # noqa: S104 — compared, not listened on

Place = tuple[str, int]
"""Host and port."""


async def reachability_findings(config: Config) -> list[Finding]:
    """Check that each address leads to a listener of this site, or to another machine that answers."""
    sync, findings = config.sync, list[Finding]()
    routes = [("sync.host", (sync.host, sync.port), "sync.bind", (sync.bind, sync.port))]
    listen = host_and_port(config.zenoh.listen)
    if listen is not None:
        routers = [router for router in map(host_and_port, config.zenoh.routers) if router is not None]
        routes += [("zenoh.connect", router, "zenoh.listen", listen) for router in routers]
    for check, target, setting, listener in routes:
        with report_failure(check, findings):
            findings.append(await _check_route(check, target, setting, listener))
    return findings


def host_and_port(endpoint: str) -> Place | None:
    """Return host and port of a zenoh endpoint; None: its protocol has none."""
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    return (host.strip("[]"), int(port)) if protocol in {"tcp", "tls"} and port.isdecimal() else None


async def _check_route(check: str, target: Place, setting: str, listener: Place) -> Finding:
    where = f"{target[0]}:{target[1]}"
    try:
        addresses = await _addresses(target[0])
    except (socket.gaierror, TimeoutError, UnicodeError) as error:
        reason = reason_of(error, "no answer from DNS")
        return bad(
            check,
            f"{where} cannot be resolved: {reason}",
            "use the server's name or address, as seen from this machine",
        )
    is_local = any(map(_is_of_this_machine, addresses))
    if is_local and target[1] == listener[1] and await _covers(listener[0], addresses):
        return ok(check, f"{where} leads to {setting}")
    refusal = await _refusal(target)
    if not refusal:
        return ok(check, f"{where} answers")
    if is_local:
        text = f"nothing listens at {where}, where cameras connect; {setting} is {listener[0]}:{listener[1]}"
        return bad(check, text, f"make {check} and {setting} agree")
    return warning(check, f"{where} does not answer: {refusal}", "start the site there, or open the firewall")


async def _addresses(host: str) -> set[str]:
    async with asyncio.timeout(_ANSWER_S):
        resolved = await asyncio.get_running_loop().getaddrinfo(host, None, type=socket.SOCK_STREAM)
    return {str(info[4][0]) for info in resolved}


def _is_of_this_machine(address: str) -> bool:
    with socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET) as probe:
        try:
            probe.bind((address, 0))
        except OSError:
            return False
    return True


async def _covers(host: str, addresses: set[str]) -> bool:
    """Return whether one of the addresses reaches a listener on ``host``."""
    try:
        return host in _ANYWHERE or not addresses.isdisjoint(await _addresses(host))
    except (socket.gaierror, TimeoutError, UnicodeError):
        return False  # reported by the check of the port


async def _refusal(target: Place) -> str:
    """Return why a connection fails; empty if it succeeds."""
    try:
        async with asyncio.timeout(_ANSWER_S):
            _, writer = await asyncio.open_connection(*target)
    except TimeoutError:
        return f"no answer within {_ANSWER_S:.0f} s"
    except OSError as error:
        return os.strerror(error.errno) if error.errno else str(error)
    writer.close()
    return ""
