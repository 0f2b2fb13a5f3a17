"""Reads sightings of people from files of recorded decisions, sampled in time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from server.messaging.messages import DECODE_ERRORS

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_Pulse = Annotated[int, msgspec.Meta(ge=0, le=1 << 53)]
_Number = Annotated[int, msgspec.Meta(ge=0, le=1 << 53)]


class _Merge(msgspec.Struct, frozen=True):
    kept: _Number
    lost: _Number


class _Decision(msgspec.Struct, frozen=True):
    """What a search needs of a recorded decision; boxes are decoded only of the frames that are sampled."""

    first: _Pulse
    frames: Annotated[int, msgspec.Meta(ge=1, le=1_000_000)]
    boxes: dict[str, list[msgspec.Raw]]
    merged: list[_Merge] = []


_DECISION = msgspec.json.Decoder(_Decision)
_BOXES = msgspec.json.Decoder(list[tuple[_Number, float, float, float, float]])


@dataclass(frozen=True, slots=True, eq=False)
class Sightings:
    """B boxes of people, by frame and camera, and the merges of that time."""

    pulses: Ints
    """(B,)"""
    numbers: Ints
    """(B,) the people."""
    cameras: Ints
    """(B,) indexes of the cameras."""
    boxes: Floats
    """(B, 4) pixels of the site's picture."""
    merges: list[tuple[int, int]] = field(default_factory=list)
    """Numbers that were kept and lost."""
    end: int = 0
    """The pulse after the last decision read."""

    def __len__(self) -> int:
        return len(self.pulses)

    def of(self, chosen: NDArray[np.bool_]) -> Sightings:
        """Return some of them: (B,)."""
        return Sightings(self.pulses[chosen], self.numbers[chosen], self.cameras[chosen], self.boxes[chosen])


def read_sightings(
    lines: Iterable[bytes], cameras: Mapping[str, int], start: int, end: int, step: int
) -> Sightings:
    """Read the boxes in the pulses ``start … end - 1`` that are multiples of ``step``, of some cameras.

    Lines that are not decisions are skipped: an incomplete last one is being written.
    """
    rows: list[tuple[int, int, int, float, float, float, float]] = []
    merges: list[tuple[int, int]] = []
    at = start
    for line in lines:
        try:
            decision = _DECISION.decode(line)
            until = decision.first + decision.frames
            if until <= at or decision.first >= end:
                continue
            begin = max(decision.first, at)
            last = min(until, end, decision.first + max(map(len, decision.boxes.values()), default=0))
            for pulse in range(-(-begin // step) * step, last, step):
                rows += _rows(decision, pulse, cameras)
        except DECODE_ERRORS:
            continue
        merges += [(merge.kept, merge.lost) for merge in decision.merged]
        at = min(until, end)
    table = np.array([row[3:] for row in rows], dtype=np.float64).reshape(-1, 4)
    keys = np.array([row[:3] for row in rows], dtype=np.int64).reshape(-1, 3)
    valid = np.isfinite(table).all(axis=1)
    return Sightings(keys[valid, 0], keys[valid, 1], keys[valid, 2], table[valid], merges, at)


def _rows(
    decision: _Decision, pulse: int, cameras: Mapping[str, int]
) -> Sequence[tuple[int, int, int, float, float, float, float]]:
    offset = pulse - decision.first
    return [
        (pulse, number, index, left, top, right, bottom)
        for camera, frames in decision.boxes.items()
        if (index := cameras.get(camera)) is not None and offset < len(frames)
        for number, left, top, right, bottom in _BOXES.decode(frames[offset])
    ]
