"""The RTSP gateway's process: starts `server.rtsp` on the system's Python, and relays what it logs."""

from __future__ import annotations

import asyncio
import json
import logging
from pathlib import Path
from typing import Any

from logthrottle import LogThrottle
from server.config.running_config import ActiveConfig
from server.config.sections import HttpSettings
from server.config.site_config import Config
from server.rtsp import PORT_IN_USE
from server.supervisor.exposure_checks import check_rtsp
from server.supervisor.sighup import reloads
from server.supervisor.startup_signal import signal_started
from server.system.child_process import run_on_python, start_on_python
from server.system.errors import UnavailableError, UserError, reason_of

log = logging.getLogger(__name__)

_PROBE = """
import gi
for name in ("Gst", "GstApp", "GstRtsp", "GstRtspServer"):
    gi.require_version(name, "1.0")
from gi.repository import Gst, GstApp, GstRtsp, GstRtspServer
Gst.init(None)
needed = ("appsrc", "rtph264pay", "rtpmp4gpay", "rtpopuspay")
missing = [name for name in needed if not Gst.ElementFactory.find(name)]
raise SystemExit(f"no {missing[0]}" if missing else 0)
"""
_PROBE_S = 60.0
_INSTALL = "on Debian: apt install python3-gi gir1.2-gst-rtsp-server-1.0"
_EVERY_INTERFACE = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}  # noqa: S104 — where to connect, not where to listen
_LINE_BYTES = 65_536
_END_S = 1.0


def check_gateway_installed(config: Config) -> None:
    """Check that GStreamer's RTSP server is there.

    Raises:
        UserError: it is not, with what to install.
    """
    python = Path(config.rtsp.python)
    try:
        probe = run_on_python(python, _PROBE, _PROBE_S)
    except OSError as error:
        raise UserError(
            f"rtsp.python: {python}: {reason_of(error)}; "
            f"the gateway needs GStreamer's RTSP server ({_INSTALL})"
        ) from error
    if probe.returncode:
        reason = (probe.stderr.strip().splitlines() or ["it failed"])[-1]
        raise UserError(f"rtsp: {python} has no GStreamer RTSP server ({reason}); {_INSTALL}")


async def rtsp_process(running: ActiveConfig) -> None:
    """Run the gateway; restart it when a reload changes its settings.

    Raises:
        UserError: GStreamer's RTSP server is missing, the port is in use, or the site is exposed by accident.
        UnavailableError: the gateway has died.
    """
    check_rtsp(running.now)
    await asyncio.to_thread(check_gateway_installed, running.now)
    changed = asyncio.Event()
    following = asyncio.create_task(_follow(running, changed), name="reload")
    try:
        while True:
            changed.clear()
            await _run(running.now, changed)
    finally:
        following.cancel()
        await asyncio.gather(following, return_exceptions=True)


def gateway_settings(config: Config) -> dict[str, Any]:
    """Return the gateway's settings, as it reads them.

    Raises:
        UserError: the service's port is not known before it runs.
    """
    rtsp = config.rtsp
    certificate = rtsp.certificate or config.http.tls.certificate
    return {
        "service": rtsp.service or _service_url(config.http),
        "service_certificate": None if certificate is None else str(certificate),
        "host": rtsp.host,
        "port": rtsp.port,
        "clients_max": rtsp.clients_max,
        "udp": rtsp.udp,
        "certificate": None if rtsp.tls.certificate is None else str(rtsp.tls.certificate),
        "key": None if rtsp.tls.key is None else str(rtsp.tls.key),
    }


def _service_url(http: HttpSettings) -> str:
    if http.port == 0:
        raise UserError("rtsp: the gateway must know the service's port: set http.port, or rtsp.service")
    host = _EVERY_INTERFACE.get(http.host, f"[{http.host}]" if ":" in http.host else http.host)
    return f"{'http' if http.tls.key is None else 'https'}://{host}:{http.port}"


async def _run(config: Config, changed: asyncio.Event) -> None:
    """Run the gateway until its settings change."""
    settings = gateway_settings(config)
    gateway = await start_on_python(Path(config.rtsp.python), "server.rtsp", _LINE_BYTES)
    assert gateway.stdin is not None  # noqa: S101 — it is a pipe
    tasks = [
        asyncio.create_task(_relay(gateway), name="log"),
        asyncio.create_task(changed.wait(), name="changed"),
    ]
    try:
        gateway.stdin.write(json.dumps(settings).encode() + b"\n")
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        if changed.is_set():
            return
        code = await gateway.wait()
        if code == PORT_IN_USE:
            raise UserError(f"rtsp.port: cannot listen on {config.rtsp.host}:{config.rtsp.port}")
        raise UnavailableError(f"rtsp: the gateway has died (exit code {code})")
    finally:
        gateway.stdin.close()  # it ends with its input
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        try:
            async with asyncio.timeout(_END_S):
                await gateway.wait()
        except TimeoutError:
            gateway.kill()
            await gateway.wait()


async def _relay(gateway: asyncio.subprocess.Process) -> None:
    """Log what the gateway writes, until it ends: its own lines, and what GStreamer warns of."""
    assert gateway.stdout is not None  # noqa: S101 — it is a pipe
    foreign = LogThrottle()
    while line := await gateway.stdout.readline():
        signal_started()  # it listens: that is its first line
        text = line.decode(errors="replace").strip()
        try:
            level, message = json.loads(text)
            log.log(int(level), "%s", message)
        except (ValueError, TypeError):
            if text and (more := foreign.record(text)) is not None:
                log.warning("%s%s", text, more)


async def _follow(running: ActiveConfig, changed: asyncio.Event) -> None:
    async for reload in reloads(running):
        before, running.now = running.now.rtsp, reload.now
        log.info("%s", reload.line)
        if running.now.rtsp != before:
            changed.set()
