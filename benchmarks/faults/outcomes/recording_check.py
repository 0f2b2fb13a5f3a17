"""What a site under fault has recorded: whether all of it plays, and whether all that was shown is there."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np

from benchmarks.faults.outcomes.fault_run import FaultOutcome
from benchmarks.faults.video.stamped_views import FPS, FRAMES, read_stamp
from benchmarks.faults.viewing.live_pictures import LiveFrameOrder, differ
from benchmarks.faults.viewing.viewers import EventLog

_GOES_ON = 5
"""So many of the last GOPs of a fault must be there, whatever it was."""


@dataclass(frozen=True, slots=True)
class RecordedFile:
    """One file of a camera.

    Attributes:
        first: its first pulse, by its name.
        frames: which frame each picture says it is, by its pulse.
        plays: to its end, and every picture is what it should be.
    """

    camera: str
    first: int
    frames: Mapping[int, int]
    plays: bool


def read(folder: Path, live: Collection[str] = ()) -> list[RecordedFile]:
    """Decode everything that was recorded, in all runs."""
    return [_read(path, live) for path in sorted(folder.glob("*/cameras/*/*.mp4"))]


def _read(path: Path, live: Collection[str]) -> RecordedFile:
    camera, plays = path.parent.name, True
    frames: dict[int, int] = {}
    course = LiveFrameOrder() if camera in live else None
    try:
        with av.open(str(path)) as container:
            for picture in container.decode(video=0):
                pulse = round(float(picture.time or 0.0) * FPS)
                stamp = read_stamp(np.asarray(picture.to_ndarray(format="gray"), dtype=np.uint8))
                frames[pulse] = -1 if stamp is None else stamp.frame
                if stamp is None or stamp.camera != camera:
                    plays = False
                elif course is None:
                    plays &= stamp.frame == pulse % FRAMES
                else:
                    plays &= not course.wrong(pulse, stamp.frame)
    except (av.error.FFmpegError, OSError):
        plays = False
    return RecordedFile(camera, int(path.stem), frames, plays)


def note(outcomes: Sequence[FaultOutcome], told: EventLog, files: Sequence[RecordedFile]) -> None:
    """Note with each fault what is not on the disk of what was shown meanwhile, and what does not play.

    Of a network camera also what is there as another picture than the one that was shown.
    """
    there: dict[str, dict[int, int]] = {}
    for file in files:
        there.setdefault(file.camera, {}).update(file.frames)
    for number, outcome in enumerate(outcomes):
        outcome.unlike = [
            note
            for received in outcome.received
            for camera, course in received.courses.items()
            for note in differ(course.frames, there.get(camera, {}))
        ]
        first, end = outcome.gops
        shown = [gop for _, gop in told.gops[first:end]]
        if not shown:
            continue
        missing = [
            gop.first
            for gop in shown
            for camera in sorted({camera for camera in gop.choices.values() if camera})
            if not there.get(camera, {}).keys() >= set(range(gop.first, gop.first + gop.frames))
        ]
        outcome.lost = len(missing)
        if outcome.fault.unrecorded and missing and missing[-1] >= shown[-min(_GOES_ON, len(shown))].first:
            outcome.failed = "the recording did not go on"
        last = number == len(outcomes) - 1
        until = shown[-1].first + shown[-1].frames
        mine = [it for it in files if shown[0].first <= it.first < until or (last and it.first >= until)]
        outcome.broken_files = sum(not file.plays for file in mine)
