"""A network camera that freezes, sends garbage, changes its resolution, jumps in time, or is away."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

from benchmarks.faults_camera import Film, NetworkCamera
from benchmarks.faults_film import CAMERAS, Views, make_smaller, make_unattractive
from benchmarks.faults_site import LEASE_S, Fault, Stand, with_up
from client import site
from server.run.setup import free_port

LIVE = CAMERAS[-1]
_BROKEN_S = 4.0
_LONG_S = 20.0
_PULSES = 6000


@contextlib.asynccontextmanager
async def with_live(views: Views, folder: Path) -> AsyncIterator[Stand]:
    """Run a site whose last camera is one of the network.

    Its boxes are still read from a file, by pulse: what it shows is kept in step with the pulses.
    """
    own = await asyncio.to_thread(make_unattractive, views, folder, LIVE, _PULSES)
    source = Path(own.cameras[-1]["source"])
    whole = await asyncio.to_thread(Film.of, source)
    smaller = await asyncio.to_thread(lambda: Film.of(make_smaller(source, folder / "smaller.mp4")))
    camera = NetworkCamera(whole, free_port())
    await camera.open()
    live = {**own.cameras[-1], "source": camera.url}
    live.pop("at_end")
    played = replace(own, cameras=[*own.cameras[:-1], live])
    try:
        async with with_up(played, folder) as stand:
            told = await site(stand.url)
            if told.pulse0 is not None:
                camera.began = told.pulse0
            stand.control, stand.live, stand.views = _Control(camera, whole, smaller), (LIVE,), played
            yield stand
    finally:
        await camera.close()


class _Control:
    """What is broken in this site."""

    def __init__(self, camera: NetworkCamera, whole: Film, smaller: Film) -> None:
        self.camera, self.whole, self.smaller = camera, whole, smaller


async def garbage(stand: Stand) -> None:
    """Send bytes that are no video for a while."""
    stand.control.camera.garbage = True
    await asyncio.sleep(_BROKEN_S)
    stand.control.camera.garbage = False


async def frozen(stand: Stand) -> None:
    """Send nothing for a while; the connection stands."""
    stand.control.camera.frozen = True
    await asyncio.sleep(_BROKEN_S)
    stand.control.camera.frozen = False


async def frozen_for_good(stand: Stand) -> None:
    """Send nothing any more."""
    stand.control.camera.frozen = True
    await asyncio.sleep(_BROKEN_S)


async def resized(stand: Stand) -> None:
    """Send pictures of another size for a while."""
    stand.control.camera.film = stand.control.smaller
    await asyncio.sleep(_BROKEN_S)
    stand.control.camera.film = stand.control.whole


async def jumped(stand: Stand) -> None:
    """Let time stamps jump ahead by an hour, and back again."""
    stand.control.camera.shift_s += 3600
    await asyncio.sleep(_BROKEN_S)
    stand.control.camera.shift_s -= 3600


async def away(stand: Stand) -> None:
    """Be away; come back with time stamps that are an hour later."""
    await stand.control.camera.close()
    await asyncio.sleep(_LONG_S)
    stand.control.camera.jump()
    await stand.control.camera.open()


_FREEZE_S = LEASE_S + 1.0

FAULTS = (
    Fault("source: garbage", with_live, garbage, 9.0, _FREEZE_S),
    Fault("source: freezes", with_live, frozen, 9.0, _FREEZE_S),
    Fault("source: another size", with_live, resized, 9.0),
    Fault("source: jumps an hour", with_live, jumped, 9.0),
    Fault("source: away, an hour later", with_live, away, 26.0, _FREEZE_S),
    Fault("source: frozen at the end", with_live, frozen_for_good, 6.0, _FREEZE_S),
)
