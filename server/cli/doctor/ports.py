"""Checks of the site's ports: free, used by this site, or used by another program."""

from __future__ import annotations

import errno
import os

import client
from camsync import Credentials, SyncError, query_clients
from server.cli.doctor.findings import Finding, bad, ok, report_failure
from server.config.pulse_access import pulse_client_tls, pulse_clients, pulse_credentials
from server.config.site_config import Config
from server.supervisor.startup_checks import check_port_free
from server.system.errors import UserError

_STOP_IT = "stop it, or use another port; if it is this site, set MYVIEW_TOKEN to one of its tokens"


_ALL = frozenset({"0.0.0.0", "::"})  # noqa: S104 — compared, not listened on


async def port_findings(config: Config) -> tuple[list[Finding], bool]:
    """Check each port.

    Returns:
        The findings, and whether this site is running already.
    """
    http, sync, zenoh = config.http, config.sync, config.zenoh
    protocol, _, address = zenoh.listen.partition("/")
    bus, _, bus_port = address.rpartition(":")
    runs = False
    findings: list[Finding] = []
    places: dict[str, tuple[str, int]] = {}
    for check, host, port in (
        ("http.port", http.host, http.port),
        ("sync.port", sync.bind, sync.port),
        ("zenoh.listen", bus.strip("[]"), int(bus_port) if bus_port.isdecimal() else 0),
    ):
        where = f"{host}:{port}"
        if check == "zenoh.listen" and protocol not in {"tcp", "tls"}:
            findings.append(ok(check, f"{zenoh.listen} is not checked before the site starts"))
            continue
        clashing = [other for other, place in places.items() if _overlap(place, (host, port))]
        places[check] = (host, port)
        if clashing:
            findings.append(
                bad(check, f"{where} is also the address of {clashing[0]}", "give each its own port")
            )
            continue
        with report_failure(check, findings):
            finding = _taken(host, port, check)
            if finding is None:
                findings.append(ok(check, f"{where} is free"))
            elif isinstance(finding, str):
                remedy = "use an address of this machine, and a port that this user may bind"
                findings.append(bad(check, finding, remedy))
            else:
                is_own = runs if check == "zenoh.listen" else await _is_this_site(config, check)
                runs = runs or is_own
                used = f"{where} is used"
                findings.append(
                    ok(check, f"{used} by this site, which is running")
                    if is_own
                    else bad(check, f"{used} by another program", _STOP_IT)
                )
    return findings, runs


def _overlap(one: tuple[str, int], other: tuple[str, int]) -> bool:
    """Return whether two processes cannot listen on both."""
    return one[1] == other[1] and (one[0] == other[0] or not _ALL.isdisjoint({one[0], other[0]}))


def _taken(host: str, port: int, check: str) -> bool | str | None:
    """Return None if a port is free, True if it is in use, or why it cannot be bound."""
    try:
        check_port_free(host, port, check)
    except UserError as error:
        cause = error.__cause__
        in_use = isinstance(cause, OSError) and cause.errno == errno.EADDRINUSE
        return in_use or str(error).removeprefix(f"{check}: ")
    return None


async def _is_this_site(config: Config, check: str) -> bool:
    """Return whether the process that uses a port is this site."""
    if check == "sync.port":
        host, credentials = _connect_host(config.sync.bind), _credentials(config)
        try:
            tls = pulse_client_tls(config)
            if tls is not None:
                tls.check_hostname = False  # the certificate names the host at which other machines connect
            listed = await query_clients(host, config.sync.port, credentials=credentials, tls=tls)
        except (SyncError, UserError):
            return False
        clients = {client.name for client in listed}
        return not clients.isdisjoint(pulse_clients(config))
    scheme = "http" if config.http.tls.key is None else "https"
    host = _connect_host(config.http.host)
    url = f"{scheme}://[{host}]" if ":" in host else f"{scheme}://{host}"
    token = os.environ.get("MYVIEW_TOKEN") or None
    settings = client.HttpSettings(connect_timeout=2.0, read_timeout=3.0, stream_retries=0, token=token)
    try:
        site = await client.site(f"{url}:{config.http.port}", settings)
    except (client.ClientError, ValueError):
        return False
    return site.name == config.site.name and set(site.cameras) == set(config.camera_ids)


def _credentials(config: Config) -> Credentials | None:
    """Return credentials of a client of this site; a camera's machine has only those of the camera."""
    for name in reversed(pulse_clients(config)):
        try:
            return pulse_credentials(config, name)
        except UserError:
            continue
    return None


def _connect_host(host: str) -> str:
    """Return the address at which this machine reaches a listener on ``host``."""
    return {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)  # noqa: S104 — it is not listened on
