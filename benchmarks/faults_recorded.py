"""What a site under fault has recorded: whether all of it plays, and whether all that was shown is there."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np

from benchmarks.faults_film import FPS, FRAMES, read_stamp
from benchmarks.faults_run import Outcome
from benchmarks.faults_viewer import Told

_GOES_ON = 5
"""So many of the last GOPs of a fault must be there, whatever it was."""


@dataclass(frozen=True, slots=True)
class File:
    """One file of a camera.

    Attributes:
        first: its first pulse, by its name.
        pulses: of the pictures in it.
        plays: to its end, and every picture is what it should be.
    """

    camera: str
    first: int
    pulses: frozenset[int]
    plays: bool


def read(folder: Path, live: Collection[str] = ()) -> list[File]:
    """Decode everything that was recorded, in all runs."""
    return [_read(path, live) for path in sorted(folder.glob("*/cameras/*/*.mp4"))]


def _read(path: Path, live: Collection[str]) -> File:
    camera, pulses, plays = path.parent.name, set(), True
    try:
        with av.open(str(path)) as container:
            for frame in container.decode(video=0):
                pulse = round(float(frame.time or 0.0) * FPS)
                stamp = read_stamp(np.asarray(frame.to_ndarray(format="gray"), dtype=np.uint8))
                pulses.add(pulse)
                plays &= stamp is not None and stamp.camera == camera
                plays &= camera in live or (stamp is not None and stamp.frame == pulse % FRAMES)
    except (av.error.FFmpegError, OSError):
        plays = False
    return File(camera, int(path.stem), frozenset(pulses), plays)


def note(outcomes: Sequence[Outcome], told: Told, files: Sequence[File]) -> None:
    """Note with each fault what is not on the disk of what was shown meanwhile, and what does not play."""
    there: dict[str, set[int]] = {}
    for file in files:
        there.setdefault(file.camera, set()).update(file.pulses)
    for number, outcome in enumerate(outcomes):
        first, end = outcome.gops
        shown = [gop for _, gop in told.gops[first:end]]
        if not shown:
            continue
        missing = [
            gop.first
            for gop in shown
            for camera in sorted({camera for camera in gop.choices.values() if camera})
            if not there.get(camera, set()).issuperset(range(gop.first, gop.first + gop.frames))
        ]
        outcome.lost = len(missing)
        if outcome.fault.unrecorded and missing and missing[-1] >= shown[-min(_GOES_ON, len(shown))].first:
            outcome.failed = "the recording did not go on"
        last = number == len(outcomes) - 1
        until = shown[-1].first + shown[-1].frames
        mine = [it for it in files if shown[0].first <= it.first < until or (last and it.first >= until)]
        outcome.broken_files = sum(not file.plays for file in mine)
