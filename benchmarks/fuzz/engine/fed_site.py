"""A small site whose service is fed with simulated messages of cameras, without a bus."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random
from typing import Any

import msgspec
import numpy as np

from server.camera.encoder import AccessUnit, Encoder
from server.config.loader import build_config
from server.config.sections import EncodeSettings, SiteSettings
from server.config.site_config import Config
from server.media.picture import Codec
from server.messaging.camera_status import CameraStatus
from server.messaging.epochs import end_of_epoch
from server.messaging.inbox import Message
from server.messaging.messages import (
    AppearanceHistogram,
    AudioHeader,
    CameraTracks,
    FrameHeader,
    SolverReport,
    ThumbnailHeader,
    TrackMessage,
    ZenohKeys,
)
from server.messaging.operator_messages import RiskEvent
from server.messaging.packed_arrays import pack_boxes, pack_histograms
from server.service.pipeline import BestViewPipeline

WIDTH, HEIGHT, FPS = 64, 48, 25
GOP = STRIDE = 5
CAMERAS = ("c0", "c1")
KEYS = ZenohKeys("hall")
_GROUND = [[0.1, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.01, 0.1]]
_SOUND_BYTES = 40
_BINS = 8

TracksMaker = Callable[[Random, str, int], CameraTracks]
"""Makes a camera's track message of an epoch."""


def site(*, codec: Codec = "h264", **changes: Any) -> Config:
    """Return the configuration of two cameras that share a floor; every epoch is a GOP."""
    content: dict[str, Any] = {
        "site": {"name": "hall", "fps": FPS, "width": WIDTH, "height": HEIGHT},
        "encode": {"gop_s": GOP / FPS, "codec": codec},
        "cameras": [{"id": camera, "source": "scene:room", "ground": _GROUND} for camera in CAMERAS],
        "track": {
            "window": {
                "length_s": 5 / FPS,
                "stride_s": STRIDE / FPS,
                "birth_s": 5 / FPS,
                "min_frames": 3,
            },
            "backlog_s": 0.2,
            "assist": {"enabled": True},
        },
        "view": {
            "lookahead_s": 2 * GOP / FPS,
            "late_after_s": 0.1,
            "identity": {"confirmation_s": 0.04, "clustering_interval_s": 0.04},
        },
        **changes,
    }
    if codec != "vp8":
        content["sound"] = {"source": "c0"}
    return build_config(content, where="hall", folder=Path())


def pictures(seed: int, frames: int, codec: Codec = "h264") -> tuple[AccessUnit, ...]:
    """Encode pictures that differ by camera (seed) and by frame."""
    encoder = Encoder(
        SiteSettings(width=WIDTH, height=HEIGHT, fps=FPS), EncodeSettings(gop_s=GOP / FPS, codec=codec)
    )
    rng = np.random.default_rng(seed)
    images = rng.integers(0, 255, (frames, HEIGHT // 8, WIDTH // 8, 3), dtype=np.uint8)
    return tuple(
        encoder.encode(pulse, np.repeat(np.repeat(picture, 8, axis=0), 8, axis=1))
        for pulse, picture in enumerate(images)
    )


def video(camera: str, unit: AccessUnit, boot: int = 1) -> Message:
    """Return a frame as a bus message."""
    head = FrameHeader(
        pulse=unit.pulse,
        key=unit.key,
        boot=boot,
        reference_pulse=None if unit.key else unit.pulse - 1,
        due=unit.pulse / FPS,
        captured_at=unit.pulse / FPS,
        encoded=unit.pulse / FPS,
    )
    return Message(KEYS.camera(camera, "video"), unit.data, msgspec.msgpack.encode(head))


def make_tracks(rng: Random, camera: str, epoch: int) -> CameraTracks:
    """Return a camera's track message of an epoch, with up to three walking people."""
    first = epoch * STRIDE
    return CameraTracks(
        camera=camera,
        boot=1,
        size=(WIDTH, HEIGHT),
        epoch=epoch,
        first=first,
        last=first + STRIDE - 1,
        final_to=first + STRIDE - 1,
        ended=False,
        shed=[first] if rng.random() < 0.1 else [],
        without_peers=[],
        tracks=[_track(rng, person, first) for person in range(1, rng.randrange(1, 5))],
        solve=SolverReport(objective=1.0, bound=1.0, gap=0.0, integral=True, rounds=1),
        solved_at=(first + STRIDE) / FPS,
        risk_events=[
            RiskEvent(
                reason="crossing", tracks=[1, 2], pulse=first + 9, margin=rng.random(), risk=rng.random()
            )
        ],
        revised_from=first if rng.random() < 0.1 else None,
    )


def _track(rng: Random, person: int, first: int) -> TrackMessage:
    left, top = rng.uniform(0, WIDTH - 16), rng.uniform(0, 16)
    boxes = [(left + step, top, left + step + 8.0, top + 24.0) for step in range(STRIDE)]
    appearance = AppearanceHistogram(
        first=first,
        last=first + STRIDE - 1,
        histogram=pack_histograms(np.eye(_BINS)[person % _BINS]),
    )
    return TrackMessage(
        id=person,
        boxes=pack_boxes(boxes),
        confidence=1.0,
        appearance=[appearance],
        sharpness=rng.choice((None, rng.random())),
    )


def make_separate_tracks(rng: Random, camera: str, epoch: int) -> CameraTracks:
    """Return a track message with one person who is visible to this camera only."""
    number, first = CAMERAS.index(camera), epoch * STRIDE
    boxes = [(4.0 + 40 * number, 10.0 + 8 * number, 14.0 + 40 * number, 34.0 + 8 * number)] * STRIDE
    appearance = [
        AppearanceHistogram(
            first=first,
            last=first + STRIDE - 1,
            histogram=pack_histograms(np.eye(_BINS)[number]),
        )
    ]
    track = TrackMessage(id=1, boxes=pack_boxes(boxes), confidence=1.0, appearance=appearance, sharpness=0.5)
    return msgspec.structs.replace(make_tracks(rng, camera, epoch), tracks=[track], shed=[])


def tracks(message: CameraTracks) -> Message:
    """Return a track message as a bus message."""
    return Message(KEYS.camera(message.camera, "tracks"), msgspec.msgpack.encode(message), b"")


def thumbnail(camera: str, pulse: int) -> Message:
    """Return a thumbnail as a bus message."""
    head = ThumbnailHeader(track=1, boot=1, pulse=pulse)
    return Message(KEYS.camera(camera, "thumbs/1"), b"\xff\xd8jpeg", msgspec.msgpack.encode(head))


def status(camera: str, pulse: int) -> Message:
    """Return a status as a bus message."""
    camera_status = CameraStatus(
        camera=camera,
        boot=1,
        state="live",
        pulse=pulse,
        fps=25.0,
        missed=0,
        shed=0,
        synchronized=True,
        clock_offset=0.0,
        round_trip=0.001,
    )
    return Message(KEYS.camera(camera, "status"), msgspec.msgpack.encode(camera_status), b"")


def sound(epoch: int) -> Message:
    """Return the audio of an epoch as a bus message."""
    head = AudioHeader(first=epoch * 9, sizes=[_SOUND_BYTES] * 9)
    return Message(KEYS.sound, bytes(_SOUND_BYTES * 9), msgspec.msgpack.encode(head))


class FedService(BestViewPipeline):
    """The best-view service without a bus; ``handle`` is what the bus would call."""

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self._handlers: Mapping[str, Callable[[Message], None]] = {
            "video": self.ingest.receive_video,
            "tracks": self.ingest.receive_tracks,
            "status": self.ingest.receive_status,
            "thumbs": self.ingest.receive_thumbnail,
        }
        self.connect(*CAMERAS)

    def connect(self, *cameras: str) -> None:
        """Mark cameras as present."""
        for camera in cameras:
            self.ingest.set_present(KEYS.camera(camera, "alive"), is_present=True)

    def handle(self, message: Message) -> None:
        """Dispatch a message by its key, as the bus does."""
        if message.key == KEYS.sound:
            self.ingest.receive_audio(message)
        parts = message.key.split("/")
        topic = parts[4] if len(parts) > 4 else ""
        if topic == "alive":
            self.ingest.set_present(message.key, is_present=message.payload == b"1")
        elif topic in self._handlers:
            self._handlers[topic](message)

    @property
    def dropped(self) -> int:
        """The number of dropped messages."""
        return sum(state.bad_messages for state in self.ingest.states.values())


def feed_epoch(
    service: FedService, rng: Random, epoch: int, epochs: int, make_tracks: TracksMaker = make_tracks
) -> None:
    """Feed a service with the valid messages of an epoch, and let it decide."""
    for seed, camera in enumerate(CAMERAS):
        for unit in pictures(seed, epochs * STRIDE)[epoch * STRIDE :][:STRIDE]:
            service.handle(video(camera, unit))
        service.handle(tracks(make_tracks(rng, camera, epoch)))
        service.handle(status(camera, epoch))
        service.handle(thumbnail(camera, epoch))
    service.handle(sound(epoch))
    service.pulses.newest = end_of_epoch(epoch, STRIDE)
    service.decide()
