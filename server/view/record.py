"""What was decided, as files: tracks per camera, the camera choices, and what came too late."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from bestview import Merge, Split
from server.view.decide import GopDecision
from server.wire.fit import Fit
from server.wire.messages import NumberedBox
from tracking.motchallenge import MotRow, format_row

CHOICES_HEAD = "frame,object,camera\n"
CORRECTIONS_HEAD = "frame,what,object,other,camera\n"
LATE_HEAD = "frame,camera,what\n"


class Recorder:
    """Writes decisions: ``tracks/<camera>.txt``, ``choices.csv``, ``corrections.csv``, ``late.csv``.

    ``fits`` may grow: a camera is in it from its first word on.

    Frames count from 1 in all of them, as in MOTChallenge files: frame 1 is pulse 0. Boxes are in pixels of
    the camera's own picture. An empty ``late.csv`` says that the files are exactly what `myview render`
    writes for the same recordings.
    """

    def __init__(self, folder: Path, cameras: Sequence[str], fits: Mapping[str, Fit]) -> None:
        self._fits = fits
        (folder / "tracks").mkdir(parents=True, exist_ok=True)
        self._tracks = {camera: _open(folder / "tracks" / f"{camera}.txt") for camera in cameras}
        self._choices = _open(folder / "choices.csv", CHOICES_HEAD)
        self._corrections = _open(folder / "corrections.csv", CORRECTIONS_HEAD)
        self._late = _open(folder / "late.csv", LATE_HEAD)

    def write(self, decision: GopDecision) -> None:
        """Write one decision."""
        for camera, frames in decision.boxes.items():
            for place, boxes in enumerate(frames):
                if boxes:
                    self._write_tracks(camera, decision.first + place + 1, boxes)
        for place in range(decision.frames):
            for choice in decision.choices:
                if choice.camera is not None and not choice.away:
                    frame = decision.first + place + 1
                    self._choices.write(f"{frame},{choice.number},{choice.camera}\n")
        for correction in decision.corrections:
            self._corrections.write(f"{decision.first + 1},{_line(correction)}\n")
        for file in (*self._tracks.values(), self._choices, self._corrections):
            file.flush()

    def late(self, camera: str, pulses: Sequence[int], what: str) -> None:
        """Note frames that came too late to count."""
        for pulse in pulses:
            self._late.write(f"{pulse + 1},{camera},{what}\n")
        self._late.flush()

    def close(self) -> None:
        """Close the files."""
        for file in (*self._tracks.values(), self._choices, self._corrections, self._late):
            file.close()

    def _write_tracks(self, camera: str, frame: int, boxes: Sequence[NumberedBox]) -> None:
        own = self._fits[camera].boxes_to_own(np.array([box for _, *box in boxes], dtype=np.float64))
        for (number, *_), (left, top, right, bottom) in zip(boxes, own.tolist(), strict=True):
            row = MotRow(frame, number, left, top, right - left, bottom - top)
            self._tracks[camera].write(format_row(row) + "\n")


def _line(correction: Merge | Split) -> str:
    if isinstance(correction, Merge):
        return f"merged,{correction.kept},{correction.lost},"
    return f"split,{correction.kept},{correction.parted},{correction.camera}"


def _open(path: Path, head: str = "") -> TextIO:
    file = path.open("w", encoding="ascii", newline="\n")
    file.write(head)
    return file
