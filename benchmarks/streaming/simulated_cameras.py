"""Simulated cameras of the streaming benchmark: H.264 of the synthetic room, simulated trackers of a hall.

    python -m benchmarks.streaming.simulated_cameras SITE.yaml PICTURES PER_CAMERA

publishes the messages of all cameras of a site on each pulse, through the real bus. The pictures are encoded
once by the site's encoder and sent in a loop, since the best-view service never decodes them.
"""

from __future__ import annotations

import asyncio
import sys
import time
from pathlib import Path

import msgspec

from benchmarks.scaling.simulated_hall import STRIDE, WINDOW, SimulatedHall, SimulatedTracker
from camsync import PulseClient
from server.camera.encoder import AccessUnit, Encoder
from server.config.loader import load_config
from server.config.sections import EncodeSettings, SiteSettings
from server.config.site_config import Config
from server.messaging.bus import Bus
from server.messaging.messages import FrameHeader, ZenohKeys
from server.system.child_process import terminate_with_parent
from synthetic import Scene

CAMERAS = 4
SITE = SiteSettings(name="stream", width=352, height=288, fps=25)
"""CIF resolution."""
ENCODE = EncodeSettings()
GOP = ENCODE.frames_per_gop(SITE.fps)
_START = 200
"""The scene's first frame: people are in sight."""


def draw_room(frames: int) -> list[list[AccessUnit]]:
    """Encode frames of the room for each camera, at about 500 kbit/s."""
    scene = Scene("room", CAMERAS, 4, 1, SITE.width, SITE.height, SITE.fps)
    films = []
    for camera in range(CAMERAS):
        encoder = Encoder(SITE, ENCODE)
        films.append([encoder.encode(frame, scene.image(camera, _START + frame)) for frame in range(frames)])
    return films


def save(films: list[list[AccessUnit]], path: Path) -> None:
    """Save encoded films."""
    path.write_bytes(msgspec.msgpack.encode(films))


def load(path: Path) -> list[list[AccessUnit]]:
    """Load encoded films."""
    return msgspec.msgpack.decode(path.read_bytes(), type=list[list[AccessUnit]])


async def serve(config: Config, films: list[list[AccessUnit]], hall: SimulatedHall) -> None:
    """Publish until terminated."""
    boot = time.time_ns() // 1_000_000
    trackers = [SimulatedTracker(hall, camera, boot) for camera in range(hall.cameras)]
    keys, bus = ZenohKeys(config.site.name), Bus.client(config.zenoh)
    service_alive = asyncio.Event()
    bus.watch_alive(keys.bestview("alive"), lambda _, alive: service_alive.set() if alive else None)
    await service_alive.wait()
    for name in hall.ids:
        bus.declare_alive(keys.camera(name, "alive"))
    client = PulseClient(config.sync.host, config.sync.port, hall.ids[0], fps_hint=config.site.fps)
    try:
        async with client as pulses:
            async for pulse in pulses:
                now = time.time()
                for name, film in zip(hall.ids, films, strict=True):
                    unit = film[pulse.number % len(film)]
                    head = FrameHeader(
                        pulse=pulse.number,
                        key=unit.key,
                        boot=boot,
                        due=pulse.due,
                        captured_at=now,
                        encoded=now,
                    )
                    bus.publish(keys.camera(name, "video"), unit.data, msgspec.msgpack.encode(head))
                if (pulse.number + 1) % STRIDE == 0:
                    places = hall.places(max(0, pulse.number + 1 - WINDOW), pulse.number)
                    for name, tracker in zip(hall.ids, trackers, strict=True):
                        message = tracker.message(pulse.number // STRIDE, places)
                        bus.publish(keys.camera(name, "tracks"), msgspec.msgpack.encode(message))
                        await asyncio.sleep(0)  # lets the bus's threads and the next pulse run
    finally:
        bus.close()


def main() -> None:
    """Read the command line and run."""
    terminate_with_parent()
    config = load_config(Path(sys.argv[1]))
    asyncio.run(serve(config, load(Path(sys.argv[2])), SimulatedHall(CAMERAS, int(sys.argv[3]))))


if __name__ == "__main__":
    main()
