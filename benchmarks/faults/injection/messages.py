"""Lost, duplicated and reordered messages, and a router that is killed.

The process :mod:`benchmarks.faults.site.lossy_bus` forwards all messages between the cameras and the other
processes. All kinds of messages occur: the cameras share the ground, and an operator keeps correcting the
watched people.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any

import aiohttp

from benchmarks.common.environment import one_thread_environment
from benchmarks.faults.injection.separate_processes import run_separately
from benchmarks.faults.site.fault_site import Fault, FaultSite, Inject
from benchmarks.faults.site.lossy_bus import CORRECTIONS, FOUND
from benchmarks.faults.video.stamped_views import CAMERAS, StampedViews
from client import Gop
from server.cli.generated_config import free_port
from server.http.access.csrf import CSRF_HEADER

_ROUTER_DOWN_S = 30.0
_FAULTY_S = 8.0
_CORRECTIONS = "/api/operator/position_corrections"
_KINDS = ("tracks", "status", FOUND, CORRECTIONS)
"""Kinds of which some messages must have been altered; thumbnails are too rare."""
_POLL_S = 0.05


class _LossyBusProcess:
    """The process that forwards messages between the cameras and the best view."""

    def __init__(self, connect: str, listen: Mapping[str, str]) -> None:
        listens = [f"{camera}={address}" for camera, address in listen.items()]
        self._words = ["-m", "benchmarks.faults.site.lossy_bus", connect, *listens]
        self._process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        pipe, environment = asyncio.subprocess.PIPE, one_thread_environment()
        self._process = await asyncio.create_subprocess_exec(
            sys.executable, *self._words, stdin=pipe, stdout=pipe, env=environment
        )

    async def set_mode(self, mode: str) -> Mapping[str, int]:
        """Set how messages are forwarded; return how many were altered so far, by kind."""
        process = self._process
        if process is None or process.stdin is None or process.stdout is None:
            return {}
        process.stdin.write(f"{mode}\n".encode())
        altered: Mapping[str, int] = json.loads(await process.stdout.readline() or b"{}")
        return altered

    async def kill(self) -> None:
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
            await self._process.wait()


@contextlib.asynccontextmanager
async def with_lossy_bus(views: StampedViews, folder: Path) -> AsyncIterator[FaultSite]:
    """Run a site whose cameras reach each other and the best view through the lossy bus only."""
    near = {camera: f"tcp/127.0.0.1:{free_port()}" for camera in CAMERAS}
    far = f"tcp/127.0.0.1:{free_port()}"
    bus_process = _LossyBusProcess(far, near)
    await bus_process.start()
    settings: Mapping[str, Mapping[str, Any]] = {
        "zenoh": {"connect": far, "listen": far},
        "track": {"assist": {"enabled": True}},
    }
    environments = {camera: {"MYVIEW_ZENOH__CONNECT": address} for camera, address in near.items()}
    try:
        async with run_separately(views, folder, settings, environments) as fault_site:
            fault_site.control = bus_process
            operator = asyncio.create_task(_operate(fault_site))
            try:
                yield fault_site
            finally:
                operator.cancel()
                await asyncio.gather(operator, return_exceptions=True)
    finally:
        await bus_process.kill()


async def _operate(fault_site: FaultSite) -> None:
    """Send an operator correction for each watched person, once a GOP, until cancelled."""
    answered = 0
    async with aiohttp.ClientSession(fault_site.url, headers={CSRF_HEADER: "1"}) as session:
        while True:
            gops = fault_site.events.gops
            if len(gops) > answered:
                answered, gop = len(gops), gops[-1][1]
                for viewer in fault_site.viewers:
                    request = _correction(gop, viewer.number)
                    if request is not None:
                        with contextlib.suppress(aiohttp.ClientError):
                            await (
                                await session.post("/api/operator/position_corrections", json=request)
                            ).read()
            await asyncio.sleep(_POLL_S)


def _correction(gop: Gop, number: int) -> dict[str, Any] | None:
    """Return the correction at a person's box in the last frame of a GOP; None: they have no box."""
    camera = gop.choices.get(number)
    boxes = gop.boxes.get(camera, ()) if camera else ()
    for box in boxes[-1] if boxes else ():
        if box.object == number:
            x, y = (box.left + box.right) / 2, (box.top + box.bottom) / 2
            point = {"pulse": gop.first + len(boxes) - 1, "x": x, "y": y}
            return {"object": number, "camera": camera, "corrections": [point]}
    return None


def distort_messages(mode: str) -> Inject:
    """Alter messages in this mode for a while."""

    async def inject(fault_site: FaultSite) -> None:
        before = await fault_site.control.set_mode(mode)
        await asyncio.sleep(_FAULTY_S)
        after = await fault_site.control.set_mode("plain")
        plain = [kind for kind in _KINDS if after.get(kind, 0) <= before.get(kind, 0)]
        if plain:
            raise RuntimeError(f"no message was altered of: {', '.join(plain)}")

    return inject


async def kill_router(fault_site: FaultSite) -> None:
    """Kill the router, and restart it after a while."""
    await fault_site.control.kill()
    await asyncio.sleep(_ROUTER_DOWN_S)
    await fault_site.control.start()


FAULTS = (
    Fault("messages: 30 % lost", with_lossy_bus, distort_messages("lost"), 10.0),
    Fault("messages: 30 % doubled", with_lossy_bus, distort_messages("doubled"), 10.0),
    Fault("messages: 30 % disordered", with_lossy_bus, distort_messages("disordered"), 10.0),
    Fault("router gone 30 s", with_lossy_bus, kill_router, 40.0, None),
)
