"""Recordings whose GOPs a test decides."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from fakes.service.scripted_cameras import CAMERAS, FPS, GOP, HEIGHT, WIDTH, encoded
from server.media.containers.fmp4 import init_segment
from server.media.stream_format import StreamFormat
from server.messaging.messages import GopChoices
from server.service.recording.age_clock import MachineClocks
from server.service.recording.media_files import RecordedGop, _fragments
from server.service.recording.recording_folder import GopRecord, RecordingFolder
from server.service.recording.retention import RetentionLimits
from server.service.recording.session_files import InitSegments, RecordingSessionInfo
from server.service.streaming.frame_buffer import FrameBuffer

A, B = CAMERAS
FRAMES = 200
PULSE0 = 1_763_700_000.0
UNLIMITED = RetentionLimits(keep_s=1e6, max_mb=1e6, segment_s=1.0)
"""Nothing is deleted; five GOPs per segment."""

Picture = NDArray[np.uint8]


class ManualClocks:
    """Machine clocks that a test sets; time passes only when :attr:`now` is set."""

    def __init__(self, now: float = PULSE0) -> None:
        self.wall, self.steady = now, 1000.0
        self.boot = "first"
        self.is_synchronized = True
        self.machine = MachineClocks(
            lambda: self.wall, lambda: self.steady, lambda: self.boot, lambda: self.is_synchronized
        )

    @property
    def now(self) -> float:
        return self.wall

    @now.setter
    def now(self, now: float) -> None:
        self.steady += now - self.wall
        self.wall = now

    def jump(self, seconds: float) -> None:
        """Set the wall clock as a user does; it is no longer synchronized."""
        self.wall += seconds
        self.is_synchronized = False

    def power_off(self, seconds: float, *, wrong_by: float = 0.0) -> None:
        """Switch the machine off for a while; afterwards its wall clock is off by ``wrong_by``."""
        self.wall += seconds + wrong_by
        self.steady = 10.0
        self.boot += ", restarted"


@cache
def filled_buffers() -> tuple[dict[str, FrameBuffer], bytes]:
    """Return a frame buffer per camera with all its frames, and the init segment."""
    stream_format = StreamFormat()
    frame_buffers = {camera: FrameBuffer(FPS, FRAMES, stream_format) for camera in CAMERAS}
    for seed, camera in enumerate(CAMERAS):
        for unit in encoded(seed, FRAMES):
            frame_buffers[camera].put(unit.pulse, 1, unit.data, key=unit.key)
    assert stream_format.parameters is not None
    return frame_buffers, init_segment(stream_format.parameters, WIDTH, HEIGHT)


@cache
def own_pictures(camera: str) -> list[Picture]:
    """Decode a camera's own stream: the picture of every pulse in YUV 4:2:0."""
    decoder = av.VideoCodecContext.create("h264", "r")
    units = encoded(CAMERAS.index(camera), FRAMES)
    return [
        frame.to_ndarray(format="yuv420p") for unit in units for frame in decoder.decode(av.Packet(unit.data))
    ]


def session_info(started: float = PULSE0, numbers_since: float | None = None) -> RecordingSessionInfo:
    return RecordingSessionInfo(
        site="hall",
        fps=FPS,
        width=WIDTH,
        height=HEIGHT,
        codec="avc1",
        cameras=list(CAMERAS),
        started=started,
        pulse0=PULSE0,
        person_numbers_since=numbers_since,
    )


def gop_record(
    gop: int, choices: Mapping[int, str], cameras: tuple[str, ...] = CAMERAS, frames: int = GOP
) -> GopRecord:
    """Return the record of a decided GOP, of which the first ``frames`` have arrived."""
    first = gop * GOP
    arrived = {}
    for camera in cameras:
        frames_of_gop = [filled_buffers()[0][camera].get(pulse) for pulse in range(first, first + frames)]
        arrived[camera] = RecordedGop(
            first, tuple(frame.fragment for frame in frames_of_gop if frame is not None)
        )
    boxes = {camera: [[(1, 1.0, 2.0, 3.0, 4.0)]] * GOP for camera in cameras}
    return GopRecord(
        GopChoices(first=first, frames=GOP, choices=dict(choices), boxes=boxes, cuts=[]), arrived
    )


def written_folder(
    store: RecordingFolder, records: list[GopRecord], started: float = PULSE0
) -> RecordingFolder:
    """Open a recording folder and write GOPs to it."""
    store.open()
    for record in records:
        store.write(record, session_info(started), InitSegments(filled_buffers()[1]))
    return store


def fragments(data: bytes) -> list[bytes]:
    """Split a part of a stream into its fragments."""
    return list(_fragments(io.BytesIO(data).read, len(data)))


def pictures(path: Path) -> Iterator[tuple[int, Picture]]:
    """Yield pulse and picture of each frame of a file or playlist on the disk."""
    with av.open(str(path), "r") as container:
        for frame in container.decode(video=0):
            yield round(float(frame.time or 0) * FPS), frame.to_ndarray(format="yuv420p")


def playable_files(folder: Path) -> list[Path]:
    return [
        path for path in sorted([*folder.rglob("*.m3u8"), *folder.rglob("*.mp4")]) if path.name != "init.mp4"
    ]
