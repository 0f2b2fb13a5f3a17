"""Check of the recordings of a site under fault: all files play, and all shown pictures are recorded."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np

from benchmarks.faults.outcomes.fault_run import FaultOutcome
from benchmarks.faults.video.stamped_views import FPS, FRAMES, read_stamp
from benchmarks.faults.viewing.live_pictures import LiveFrameOrder, find_differences
from benchmarks.faults.viewing.viewers import EventLog
from client import Gop

_MIN_RESUMED_GOPS = 5
"""GOPs at the end of a fault that must be recorded in any case."""


@dataclass(frozen=True, slots=True)
class RecordedFile:
    """A recorded file of a camera.

    Attributes:
        camera: of the file.
        first: its first pulse, from its name.
        frames: the stamped frame number of each picture, by pulse.
        plays: it decodes to its end, and every picture is the expected one.
    """

    camera: str
    first: int
    frames: Mapping[int, int]
    plays: bool


def read(folder: Path, live: Collection[str] = ()) -> list[RecordedFile]:
    """Decode all recorded files of all recording sessions."""
    return [_read(path, live) for path in sorted(folder.glob("*/cameras/*/*.mp4"))]


def _read(path: Path, live: Collection[str]) -> RecordedFile:
    camera, plays = path.parent.name, True
    frames: dict[int, int] = {}
    order = LiveFrameOrder() if camera in live else None
    try:
        with av.open(str(path)) as container:
            for picture in container.decode(video=0):
                pulse = round(float(picture.time or 0.0) * FPS)
                stamp = read_stamp(np.asarray(picture.to_ndarray(format="gray"), dtype=np.uint8))
                frames[pulse] = -1 if stamp is None else stamp.frame
                if stamp is None or stamp.camera != camera:
                    plays = False
                elif order is None:
                    plays &= stamp.frame == pulse % FRAMES
                else:
                    plays &= not order.check(pulse, stamp.frame)
    except (av.error.FFmpegError, OSError):
        plays = False
    return RecordedFile(camera, int(path.stem), frames, plays)


def recorded_frames(files: Sequence[RecordedFile]) -> dict[str, dict[int, int]]:
    """Return by camera the recorded frame of each pulse."""
    recorded: dict[str, dict[int, int]] = {}
    for file in files:
        recorded.setdefault(file.camera, {}).update(file.frames)
    return recorded


def unrecorded(shown: Sequence[Gop], recorded: Mapping[str, Mapping[int, int]]) -> list[int]:
    """Return the first pulses of the GOPs of which a shown camera was not recorded, once for each camera."""
    return [
        gop.first
        for gop in shown
        for camera in sorted({camera for camera in gop.choices.values() if camera})
        if not recorded.get(camera, {}).keys() >= set(range(gop.first, gop.first + gop.frames))
    ]


def add_recording_results(
    outcomes: Sequence[FaultOutcome], events: EventLog, files: Sequence[RecordedFile]
) -> None:
    """Add to each outcome its lost GOPs, broken files, and mismatches of a network camera."""
    recorded = recorded_frames(files)
    for number, outcome in enumerate(outcomes):
        outcome.mismatches = [
            note
            for received in outcome.received
            for camera, order in received.live_orders.items()
            for note in find_differences(order.frames, recorded.get(camera, {}))
        ]
        first, end = outcome.gops
        shown = [gop for _, gop in events.gops[first:end]]
        if not shown:
            continue
        missing = unrecorded(shown, recorded)
        outcome.lost = len(missing)
        if (
            outcome.fault.stops_recording
            and missing
            and missing[-1] >= shown[-min(_MIN_RESUMED_GOPS, len(shown))].first
        ):
            outcome.failed = "the recording did not resume"
        last = number == len(outcomes) - 1
        until = shown[-1].first + shown[-1].frames
        own_files = [
            file for file in files if shown[0].first <= file.first < until or (last and file.first >= until)
        ]
        outcome.broken_files = sum(not file.plays for file in own_files)
