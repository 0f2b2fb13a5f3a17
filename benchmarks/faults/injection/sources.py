"""A network camera that freezes, sends garbage, changes its resolution, jumps in time, or is away."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

from benchmarks.faults.site.fault_site import LEASE_S, Fault, FaultSite, Inject, with_up
from benchmarks.faults.video.network_camera import EncodedFilm, NetworkCamera
from benchmarks.faults.video.stamp_detector import write_reader
from benchmarks.faults.video.stamped_views import CAMERAS, StampedViews, make_smaller, make_unattractive
from client import site
from server.cli.generated_config import free_port

LIVE = CAMERAS[-1]
_BROKEN_S = 4.0
_LONG_S = 20.0
_PULSES = 6000


@contextlib.asynccontextmanager
async def with_live(views: StampedViews, folder: Path) -> AsyncIterator[FaultSite]:
    """Run a site whose last camera is one of the network.

    Which picture it has at a pulse is not known beforehand: people are found in it by what it says it is.

    Raises:
        CannotRunError: the network that reads this cannot be made or run here.
    """
    own = await asyncio.to_thread(make_unattractive, views, folder, LIVE, _PULSES)
    reader = await asyncio.to_thread(write_reader, own, LIVE, folder / "reader.onnx")
    source = Path(own.cameras[-1]["source"])
    whole = await asyncio.to_thread(EncodedFilm.of, source)
    smaller = await asyncio.to_thread(lambda: EncodedFilm.of(make_smaller(source, folder / "smaller.mp4")))
    camera = NetworkCamera(whole, free_port())
    await camera.open()
    live = {**own.cameras[-1], "source": camera.url}
    for of_a_recording in ("at_end", "detections"):
        live.pop(of_a_recording)
    played = replace(own, cameras=[*own.cameras[:-1], live])
    detect = {"kind": "onnx", "onnx": {"model": str(reader), "nms_iou": 1.0}}
    try:
        async with with_up(played, folder, {"detect": detect}) as stand:
            told = await site(stand.url)
            if told.pulse0 is not None:
                camera.began = told.pulse0
                await stand.settle()
            stand.control, stand.live, stand.views = _CameraControl(camera, whole, smaller), (LIVE,), played
            yield stand
    finally:
        await camera.close()


class _CameraControl:
    """What is broken in this site."""

    def __init__(self, camera: NetworkCamera, whole: EncodedFilm, smaller: EncodedFilm) -> None:
        self.camera, self.whole, self.smaller = camera, whole, smaller


async def garbage(stand: FaultSite) -> None:
    """Send bytes that are no video for a while."""
    stand.control.camera.garbage = True
    await asyncio.sleep(_BROKEN_S)
    stand.control.camera.garbage = False


async def frozen(stand: FaultSite) -> None:
    """Send nothing for a while; the connection stands."""
    stand.control.camera.frozen = True
    await asyncio.sleep(_BROKEN_S)
    stand.control.camera.frozen = False


async def frozen_for_good(stand: FaultSite) -> None:
    """Send nothing any more."""
    stand.control.camera.frozen = True
    await asyncio.sleep(_BROKEN_S)


async def resized(stand: FaultSite) -> None:
    """Send pictures of another size for a while."""
    stand.control.camera.film = stand.control.smaller
    await asyncio.sleep(_BROKEN_S)
    stand.control.camera.film = stand.control.whole


async def jumped(stand: FaultSite) -> None:
    """Let time stamps jump ahead by an hour, and back again."""
    stand.control.camera.shift_s += 3600
    await asyncio.sleep(_BROKEN_S)
    stand.control.camera.shift_s -= 3600


async def away(stand: FaultSite) -> None:
    """Be away; come back with time stamps that are an hour later.

    It is tried again ever more seldom, but from 15.5 s on every 10 s, so that the site does at the end of an
    hour what it does after these 20 s. The site's own clock is not moved: pulses count on whoever is away.
    """
    await stand.control.camera.close()
    await asyncio.sleep(_LONG_S)
    stand.control.camera.jump()
    await stand.control.camera.open()


def while_shown(inject: Inject) -> Inject:
    """Have somebody watch what is about to break."""

    async def injected(stand: FaultSite) -> None:
        if LIVE not in [stand.told.shown(viewer.number) for viewer in stand.viewers]:
            raise RuntimeError(f"nobody is shown camera {LIVE}")
        await inject(stand)

    return injected


_FREEZE_S = LEASE_S + 1.0

FAULTS = (
    Fault("source: garbage", with_live, while_shown(garbage), 9.0, _FREEZE_S),
    Fault("source: freezes", with_live, while_shown(frozen), 9.0, _FREEZE_S),
    Fault("source: another size", with_live, while_shown(resized), 9.0),
    Fault("source: jumps an hour", with_live, while_shown(jumped), 9.0),
    Fault("source: away 20 s, stamps +1 h", with_live, while_shown(away), 26.0, _FREEZE_S),
    Fault("source: frozen at the end", with_live, while_shown(frozen_for_good), 6.0, _FREEZE_S),
)
