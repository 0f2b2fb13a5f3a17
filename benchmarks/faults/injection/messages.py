"""Messages that are lost, doubled or in another order, and a router that is gone.

The process :mod:`benchmarks.faults.site.lossy_bus` stands between the cameras and all other processes. All
kinds of messages pass it: the cameras look at the same ground, and an operator keeps pointing at the people
whom viewers watch.
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
from benchmarks.faults.injection.separate_processes import apart
from benchmarks.faults.site.fault_site import Fault, FaultSite, Inject
from benchmarks.faults.site.lossy_bus import FOUND, POINTING
from benchmarks.faults.video.stamped_views import CAMERAS, StampedViews
from client import Gop
from server.cli.generated_config import free_port
from server.http.access.csrf import CSRF_HEADER

_GONE_S = 30.0
_FAULTY_S = 8.0
_KINDS = ("tracks", "status", FOUND, POINTING)
"""Of each of these some must have been lost, doubled or disordered; small pictures are seldom."""
_POLL_S = 0.05


class _LossyBusProcess:
    """The process in the middle."""

    def __init__(self, connect: str, listen: Mapping[str, str]) -> None:
        listens = [f"{camera}={address}" for camera, address in listen.items()]
        self._words = ["-m", "benchmarks.faults.site.lossy_bus", connect, *listens]
        self._process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        pipe, environment = asyncio.subprocess.PIPE, one_thread_environment()
        self._process = await asyncio.create_subprocess_exec(
            sys.executable, *self._words, stdin=pipe, stdout=pipe, env=environment
        )

    async def say(self, word: str) -> Mapping[str, int]:
        """Return how messages pass from now on; give how many have not passed plainly so far, by kind."""
        process = self._process
        if process is None or process.stdin is None or process.stdout is None:
            return {}
        process.stdin.write(f"{word}\n".encode())
        said: Mapping[str, int] = json.loads(await process.stdout.readline() or b"{}")
        return said

    async def kill(self) -> None:
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
            await self._process.wait()


@contextlib.asynccontextmanager
async def with_middle(views: StampedViews, folder: Path) -> AsyncIterator[FaultSite]:
    """Run a site whose cameras reach each other and the best view by a process in the middle only."""
    near = {camera: f"tcp/127.0.0.1:{free_port()}" for camera in CAMERAS}
    far = f"tcp/127.0.0.1:{free_port()}"
    middle = _LossyBusProcess(far, near)
    await middle.start()
    settings: Mapping[str, Mapping[str, Any]] = {
        "zenoh": {"connect": far, "listen": far},
        "track": {"assist": {"enabled": True}},
    }
    own = {camera: {"MYVIEW_ZENOH__CONNECT": address} for camera, address in near.items()}
    try:
        async with apart(views, folder, settings, own) as stand:
            stand.control = middle
            operator = asyncio.create_task(_operate(stand))
            try:
                yield stand
            finally:
                operator.cancel()
                await asyncio.gather(operator, return_exceptions=True)
    finally:
        await middle.kill()


async def _operate(stand: FaultSite) -> None:
    """Point at whom viewers watch, once a GOP, where they really are: until cancelled."""
    pointed = 0
    async with aiohttp.ClientSession(stand.url, headers={CSRF_HEADER: "1"}) as session:
        while True:
            told = stand.told.gops
            if len(told) > pointed:
                pointed, gop = len(told), told[-1][1]
                for viewer in stand.viewers:
                    said = _pointing(gop, viewer.number)
                    if said is not None:
                        with contextlib.suppress(aiohttp.ClientError):
                            await (await session.post("/api/operator/pointing", json=said)).read()
            await asyncio.sleep(_POLL_S)


def _pointing(gop: Gop, number: int) -> dict[str, Any] | None:
    """Return where somebody is in the last frame of a GOP; None: they are in no box."""
    camera = gop.choices.get(number)
    boxes = gop.boxes.get(camera, ()) if camera else ()
    for box in boxes[-1] if boxes else ():
        if box.object == number:
            x, y = (box.left + box.right) / 2, (box.top + box.bottom) / 2
            point = {"pulse": gop.first + len(boxes) - 1, "x": x, "y": y}
            return {"object": number, "camera": camera, "points": [point]}
    return None


def passed(how: str) -> Inject:
    """Let messages pass in some way for a while."""

    async def inject(stand: FaultSite) -> None:
        before = await stand.control.say(how)
        await asyncio.sleep(_FAULTY_S)
        after = await stand.control.say("plain")
        plain = [kind for kind in _KINDS if after.get(kind, 0) <= before.get(kind, 0)]
        if plain:
            raise RuntimeError(f"nothing has befallen any message of: {', '.join(plain)}")

    return inject


async def router_gone(stand: FaultSite) -> None:
    """Kill the router, and start it again after a while."""
    await stand.control.kill()
    await asyncio.sleep(_GONE_S)
    await stand.control.start()


FAULTS = (
    Fault("messages: 30 % lost", with_middle, passed("lost"), 10.0),
    Fault("messages: 30 % doubled", with_middle, passed("doubled"), 10.0),
    Fault("messages: 30 % disordered", with_middle, passed("disordered"), 10.0),
    Fault("router gone 30 s", with_middle, router_gone, 40.0, None),
)
