"""Faults of a network camera: freezes, garbage, another resolution, timestamp jumps, disconnection."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

from benchmarks.faults.site.fault_site import LEASE_S, Fault, FaultSite, Inject, with_up
from benchmarks.faults.video.network_camera import EncodedFilm, NetworkCamera
from benchmarks.faults.video.stamp_detector import write_stamp_detector
from benchmarks.faults.video.stamped_views import (
    CAMERAS,
    StampedViews,
    shrink_other_detections,
    write_smaller_film,
)
from client import site
from server.cli.generated_config import free_port

NETWORK_CAMERA = CAMERAS[-1]
_FAULT_S = 4.0
_LONG_S = 20.0
_PULSES = 6000


@contextlib.asynccontextmanager
async def with_network_camera(views: StampedViews, folder: Path) -> AsyncIterator[FaultSite]:
    """Run a site whose last camera is a network camera.

    Its picture at a pulse is not known beforehand, so its detector reads the number in the picture.

    Raises:
        CannotRunError: the detector's ONNX network cannot be created or run.
    """
    adapted = await asyncio.to_thread(shrink_other_detections, views, folder, NETWORK_CAMERA, _PULSES)
    reader = await asyncio.to_thread(write_stamp_detector, adapted, NETWORK_CAMERA, folder / "reader.onnx")
    source = Path(adapted.cameras[-1]["source"])
    full_size = await asyncio.to_thread(EncodedFilm.of, source)
    smaller = await asyncio.to_thread(
        lambda: EncodedFilm.of(write_smaller_film(source, folder / "smaller.mp4"))
    )
    camera = NetworkCamera(full_size, free_port())
    await camera.open()
    live = {**adapted.cameras[-1], "source": camera.url}
    for key in ("at_end", "detections"):
        live.pop(key)
    played = replace(adapted, cameras=[*adapted.cameras[:-1], live])
    detect = {"kind": "onnx", "onnx": {"model": str(reader), "nms_iou": 1.0}}
    try:
        async with with_up(played, folder, {"detect": detect}) as fault_site:
            site_state = await site(fault_site.url)
            if site_state.pulse0 is not None:
                camera.began = site_state.pulse0
                await fault_site.settle()
            fault_site.control, fault_site.live, fault_site.views = (
                _CameraControl(camera, full_size, smaller),
                (NETWORK_CAMERA,),
                played,
            )
            yield fault_site
    finally:
        await camera.close()


class _CameraControl:
    """The network camera of the site, and its two films."""

    def __init__(self, camera: NetworkCamera, full_size: EncodedFilm, smaller: EncodedFilm) -> None:
        self.camera, self.full_size, self.smaller = camera, full_size, smaller


async def send_garbage(fault_site: FaultSite) -> None:
    """Send random bytes for a while."""
    fault_site.control.camera.garbage = True
    await asyncio.sleep(_FAULT_S)
    fault_site.control.camera.garbage = False


async def freeze(fault_site: FaultSite) -> None:
    """Stop sending for a while, with the connection open."""
    fault_site.control.camera.frozen = True
    await asyncio.sleep(_FAULT_S)
    fault_site.control.camera.frozen = False


async def freeze_forever(fault_site: FaultSite) -> None:
    """Stop sending forever."""
    fault_site.control.camera.frozen = True
    await asyncio.sleep(_FAULT_S)


async def resize(fault_site: FaultSite) -> None:
    """Send pictures of another size for a while."""
    fault_site.control.camera.film = fault_site.control.smaller
    await asyncio.sleep(_FAULT_S)
    fault_site.control.camera.film = fault_site.control.full_size


async def jump_timestamps(fault_site: FaultSite) -> None:
    """Let timestamps jump ahead by an hour, and back again."""
    fault_site.control.camera.shift_s += 3600
    await asyncio.sleep(_FAULT_S)
    fault_site.control.camera.shift_s -= 3600


async def disconnect(fault_site: FaultSite) -> None:
    """Disconnect; come back with timestamps an hour later.

    Retries become rarer, but from 15.5 s on they come every 10 s, so 20 s stand for an hour. The site's clock
    is not changed: pulses continue without the camera.
    """
    await fault_site.control.camera.close()
    await asyncio.sleep(_LONG_S)
    fault_site.control.camera.jump()
    await fault_site.control.camera.open()


def while_shown(inject: Inject) -> Inject:
    """Inject a fault only while a viewer is shown the network camera."""

    async def injected(fault_site: FaultSite) -> None:
        if NETWORK_CAMERA not in [fault_site.events.shown(viewer.number) for viewer in fault_site.viewers]:
            raise RuntimeError(f"no viewer is shown camera {NETWORK_CAMERA}")
        await inject(fault_site)

    return injected


_FREEZE_S = LEASE_S + 1.0

FAULTS = (
    Fault("source: garbage", with_network_camera, while_shown(send_garbage), 9.0, _FREEZE_S),
    Fault("source: freezes", with_network_camera, while_shown(freeze), 9.0, _FREEZE_S),
    Fault("source: another size", with_network_camera, while_shown(resize), 9.0),
    Fault("source: jumps an hour", with_network_camera, while_shown(jump_timestamps), 9.0),
    Fault("source: away 20 s, stamps +1 h", with_network_camera, while_shown(disconnect), 26.0, _FREEZE_S),
    Fault("source: frozen at the end", with_network_camera, while_shown(freeze_forever), 6.0, _FREEZE_S),
)
