"""A process that simulates many cameras: on each pulse it publishes their messages through the real bus.

    python -m benchmarks.scaling.simulated_cameras SITE.yaml PER_CAMERA FIRST COUNT

Pictures are one small GOP, encoded once and sent in a loop: the best-view service never decodes them. So are
thumbnails, one for each track every second.
"""

from __future__ import annotations

import asyncio
import sys
import time
from pathlib import Path

import msgspec
import numpy as np

from benchmarks.scaling.simulated_hall import HEIGHT, STRIDE, WIDTH, WINDOW, SimulatedHall, SimulatedTracker
from camsync import Pulse, PulseClient
from server.camera.encoder import AccessUnit, Encoder
from server.config.loader import load_config
from server.config.site_config import Config
from server.messaging.bus import Bus
from server.messaging.messages import CameraTracks, FrameHeader, ThumbnailHeader, ZenohKeys
from server.system.child_process import terminate_with_parent

_THUMBS_EVERY = 5
"""Epochs."""
_THUMB = bytes(1500)
"""A dummy of the size of a thumbnail."""


async def serve(config: Config, hall: SimulatedHall, cameras: range) -> None:
    """Publish until terminated."""
    boot = time.time_ns() // 1_000_000
    trackers = {camera: SimulatedTracker(hall, camera, boot) for camera in cameras}
    keys, bus = ZenohKeys(config.site.name), Bus.client(config.zenoh)
    encoder = Encoder(config.site, config.encode)
    gray = np.full((HEIGHT, WIDTH, 3), 128, dtype=np.uint8)
    gop = [encoder.encode(frame, gray) for frame in range(config.gop)]
    there = asyncio.Event()
    bus.watch_alive(keys.bestview("alive"), lambda _, alive: there.set() if alive else None)
    await there.wait()
    for camera in cameras:
        bus.declare_alive(keys.camera(hall.ids[camera], "alive"))
    client = PulseClient(config.sync.host, config.sync.port, hall.ids[cameras[0]], fps_hint=config.site.fps)
    try:
        async with client as pulses:
            async for pulse in pulses:
                unit = gop[pulse.number % len(gop)]
                _frames(
                    bus, [keys.camera(hall.ids[camera], "video") for camera in cameras], unit, pulse, boot
                )
                if (pulse.number + 1) % STRIDE == 0:
                    epoch = pulse.number // STRIDE
                    places = hall.places(max(0, pulse.number + 1 - WINDOW), pulse.number)
                    for camera in cameras:
                        message = trackers[camera].message(epoch, places)
                        _tracks(bus, keys, message)
                        if epoch % _THUMBS_EVERY == 0:
                            _thumbnails(bus, keys, message)
                        # Lets the bus's threads and the next pulse run.
                        await asyncio.sleep(0)
    finally:
        bus.close()


def _frames(bus: Bus, keys: list[str], unit: AccessUnit, pulse: Pulse, boot: int) -> None:
    now = time.time()
    head = FrameHeader(pulse=pulse.number, key=unit.key, boot=boot, due=now, captured_at=now, encoded=now)
    attachment = msgspec.msgpack.encode(head)
    for key in keys:
        bus.publish(key, unit.data, attachment)


def _tracks(bus: Bus, keys: ZenohKeys, message: CameraTracks) -> None:
    bus.publish(keys.camera(message.camera, "tracks"), msgspec.msgpack.encode(message))


def _thumbnails(bus: Bus, keys: ZenohKeys, message: CameraTracks) -> None:
    for track in message.tracks:
        head = ThumbnailHeader(track=track.id, boot=message.boot, pulse=message.last)
        bus.publish(keys.camera(message.camera, f"thumbs/{track.id}"), _THUMB, msgspec.msgpack.encode(head))


def main() -> None:
    """Read the command line and run."""
    terminate_with_parent()
    path, per_camera, first, count = sys.argv[1], *map(int, sys.argv[2:])
    config = load_config(Path(path))
    hall = SimulatedHall(len(config.cameras), per_camera)
    asyncio.run(serve(config, hall, range(first, first + count)))


if __name__ == "__main__":
    main()
