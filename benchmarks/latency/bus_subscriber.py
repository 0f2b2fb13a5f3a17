"""A zenoh subscriber that records the arrival and the timestamps of a site's messages."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import msgspec
import zenoh

from server.messaging.messages import CameraTracks, FrameHeader, GopChoices, camera_of_key


@dataclass(frozen=True, slots=True)
class FrameTimes:
    """Timestamps of an access unit of a camera, unix seconds."""

    due: float
    captured_at: float
    encoded: float
    received: float


@dataclass(frozen=True, slots=True)
class DecisionRecord:
    """The view choices of a GOP."""

    first: int
    frames: int
    choices: dict[int, str]
    """The camera of each object."""
    received: float


@dataclass(slots=True)
class BusTimestamps:
    """Timestamps of the messages on the bus."""

    frames: dict[tuple[str, int], FrameTimes] = field(default_factory=dict)
    """By camera and pulse."""
    solved: dict[int, dict[str, float]] = field(default_factory=dict)
    """When each camera solved a window, by the window's last pulse."""
    decisions: list[DecisionRecord] = field(default_factory=list)
    shed: int = 0
    """Frames that were missed or not searched, of all cameras."""

    def video(self, camera: str, head: FrameHeader, received: float) -> None:
        """Add a frame."""
        self.frames[camera, head.pulse] = FrameTimes(head.due, head.captured_at, head.encoded, received)

    def tracks(self, message: CameraTracks) -> None:
        """Add a window."""
        self.solved.setdefault(message.last, {})[message.camera] = message.solved_at
        self.shed += len(message.shed)

    def choices(self, message: GopChoices, received: float) -> None:
        """Add a decision."""
        self.decisions.append(DecisionRecord(message.first, message.frames, message.choices, received))


@contextlib.contextmanager
def listening(address: str) -> Iterator[BusTimestamps]:
    """Subscribe to the messages of the site whose router is at the address."""
    marks = BusTimestamps()
    head, tracks = msgspec.json.Decoder(FrameHeader), msgspec.json.Decoder(CameraTracks)
    choices = msgspec.json.Decoder(GopChoices)

    def on_video(sample: zenoh.Sample) -> None:
        received = time.time()
        if sample.attachment is not None:
            marks.video(
                camera_of_key(str(sample.key_expr)), head.decode(sample.attachment.to_bytes()), received
            )

    def on_tracks(sample: zenoh.Sample) -> None:
        marks.tracks(tracks.decode(sample.payload.to_bytes()))

    def on_choices(sample: zenoh.Sample) -> None:
        marks.choices(choices.decode(sample.payload.to_bytes()), time.time())

    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([address]))
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as session:
        heard = {"camera/*/video": on_video, "camera/*/tracks": on_tracks, "bestview/choices": on_choices}
        subscribers = [session.declare_subscriber(f"myview/*/{key}", on) for key, on in heard.items()]
        try:
            yield marks
        finally:
            for subscriber in subscribers:
                subscriber.undeclare()  # type: ignore[no-untyped-call]
