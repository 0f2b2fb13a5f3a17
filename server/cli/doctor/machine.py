"""Checks of the machine: clock synchronization, processor, memory, open files."""

from __future__ import annotations

import asyncio
import ssl
import time
from collections.abc import Mapping
from pathlib import Path

from camsync.messages import Greeting, LoginRequest
from camsync.protocol import ProtocolError, parse_server_line
from server.cli.doctor.camera_probe import CameraProbe
from server.cli.doctor.findings import Finding, ok, warning
from server.config.pulse_access import pulse_client_tls
from server.config.site_config import Config
from server.http.connections.connection_limit import connection_limit
from server.system.clock_sync import is_clock_synchronized
from server.system.processors import available_processors

_MAX_OFFSET_S = 1.0
_ANSWER_S = 2.0
_SERVICE_CORES = 0.3
"""Cores of the best view with a few cameras and viewers, and of the pulse server: docs/how-to/scale.md."""
_MAX_LOAD = 0.8
"""Share of the cores above which nothing is left for a busy scene."""
_PROCESS_MB = 250
"""Memory of a process without pictures: libraries and tracker."""


async def clock_findings(config: Config) -> list[Finding]:
    """Check that NTP synchronizes this machine's clock, and compare it with the pulse server's."""
    findings = [_ntp_finding(config)]
    offset = await _clock_offset(config.sync.host, config.sync.port, pulse_client_tls(config))
    if offset is None:
        findings.append(ok("pulse server", "is not running: its clock cannot be compared"))
    elif abs(offset) > _MAX_OFFSET_S:
        text = f"its clock is {offset:+.1f} s off this machine's"
        findings.append(
            warning(
                "pulse server", text, "use NTP: frames do not depend on the clock, logs and recorded times do"
            )
        )
    else:
        findings.append(ok("pulse server", f"its clock is {1000 * offset:+.0f} ms off this machine's"))
    return findings


def machine_findings(config: Config, probes: Mapping[str, CameraProbe]) -> list[Finding]:
    """Compare the load of all cameras with this machine, assuming that all run here."""
    cores = available_processors()
    failed = [camera for camera, probe in probes.items() if probe.problem]
    needed = sum(probe.cores for probe in probes.values()) + _SERVICE_CORES
    subject = "all cameras" if not failed else f"without {', '.join(failed)}, the cameras"
    text = f"{subject} and the best view take about {needed:.1f} of {cores:.3g} cores"
    findings = [
        ok("processor", text)
        if needed <= _MAX_LOAD * cores
        else warning(
            "processor", text, "lower site.fps or detect.work_width, or put cameras on other machines"
        )
    ]
    free = available_mb()
    if free is not None:
        site = config.site
        pictures = 3 * site.width * site.height * config.track.backlog_s * site.fps / 1e6
        needed_mb = len(config.cameras) * (_PROCESS_MB + pictures) + 2 * _PROCESS_MB
        text = f"takes up to {needed_mb:.0f} MB while it is busy; {free:.0f} MB are free"
        findings.append(
            ok("memory", text)
            if needed_mb <= free
            else warning("memory", text, "lower track.backlog_s, use fewer cameras, or add memory")
        )
    return findings


def descriptor_findings(config: Config, descriptors: int) -> list[Finding]:
    """Check that the limit of open files allows the configured connections and viewers."""
    configured, most = config.http.connections, connection_limit(config, descriptors)
    viewers = min(config.http.viewers_max, most)
    limit = f"{descriptors} files may be open: {most} connections"
    if viewers < config.http.viewers_max:
        text = f"{limit}, and so {viewers} viewers; http.viewers_max is {config.http.viewers_max}"
    elif most < configured:
        text = f"{limit}, {viewers} viewers among them; http.connections_max is {configured}"
    else:
        return [ok("open files", f"{limit} and {viewers} viewers fit")]
    remedy = (
        "raise the hard limit: ulimit -Hn, LimitNOFILE= of systemd, ulimits of compose; or lower settings"
    )
    return [warning("open files", text, remedy)]


def available_mb() -> float | None:
    """Return the available memory in megabytes; None: the system does not report it."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    kilobytes = next((line.split()[1] for line in lines if line.startswith("MemAvailable:")), None)
    return None if kilobytes is None else int(kilobytes) * 1024 / 1e6


def _ntp_finding(config: Config) -> Finding:
    synchronized = is_clock_synchronized()
    if synchronized is None:
        return ok("clock", "the system does not report whether NTP synchronizes it")
    if synchronized:
        return ok("clock", "is synchronized by NTP")
    text, remedy = (
        "is not synchronized by NTP",
        "timedatectl set-ntp true, or chrony; frames do not depend on it",
    )
    if config.record.folder is not None and not config.record.trust_clock:
        text += ": recordings do not age while this machine is off"
        remedy += ". If the clock keeps running: record.trust_clock: true"
    return warning("clock", text, remedy)


async def _clock_offset(host: str, port: int, tls: ssl.SSLContext | None) -> float | None:
    """Return the pulse server's clock minus this one in seconds, from its first line; None: no answer."""
    try:
        async with asyncio.timeout(_ANSWER_S):
            sent = time.time()
            reader, writer = await asyncio.open_connection(host, port, ssl=tls)
            try:
                greeting = parse_server_line((await reader.readline()).rstrip(b"\r\n"))
            finally:
                writer.close()
    except (OSError, TimeoutError, ProtocolError, ValueError):
        return None
    return greeting.now - (sent + time.time()) / 2 if isinstance(greeting, Greeting | LoginRequest) else None
