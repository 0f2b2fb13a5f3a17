"""Identity failures: a fish continues under another track id."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper_experiments.scene import ObjectTruth
from tracking.assignment import assign_pairs
from tracking.boxes import Floats, iou

_LEAST_IOU = 0.3
"""Overlap (IoU) from which a track is on a fish: boxes of turning bodies are rarely exact."""
_LASTS_S = 1.0 / 3.0
"""Seconds for which a fish must have another id: shorter changes belong to the crossing."""
_TOGETHER_S = 1.0
"""Seconds within which failures of the same fish or tracks are merged: a swap is one failure of two fish."""

_IN_THE_WAY = 0.05
"""Overlap (IoU) from which another fish is in the way."""

Kind = Literal["alone", "2 way", "3 way"]
"""The number of fish in each other's way: alone, two, or three and more."""

Tracks = Mapping[int, Mapping[int, Floats]]
"""The boxes `(4,)` of tracks, by frame and id."""


@dataclass(frozen=True, slots=True)
class IdentityFailure:
    """An identity failure.

    Attributes:
        frame: the first frame in which a fish has another id.
        before: the last frame in which it had its own.
        fish: whose id changes, ascending.
        tracks: their ids before and after, ascending.
        involved: number of fish in each other's way around the failure (see `involved`); 1: alone.
    """

    frame: int
    before: int
    fish: tuple[int, ...]
    tracks: tuple[int, ...]
    involved: int

    @property
    def kind(self) -> Kind:
        """The kind by the number of involved fish."""
        return kind_of(self.involved)


def kind_of(together: int) -> Kind:
    """Return the kind by the number of fish in each other's way."""
    return "alone" if together < 2 else "2 way" if together == 2 else "3 way"


def involved(truth: ObjectTruth, fish: Collection[int], first: int, last: int, fps: float) -> int:
    """Count the given fish that others overlap, and these others; 1: there are none.

    From a third of a second before the frame `first` to a third of a second after the frame `last`.
    """
    around = round(_LASTS_S * fps)
    boxes = np.nan_to_num(truth.boxes[:, max(first - around, 0) : last + around])
    together: set[int] = set()
    for one in fish:
        overlaps = (iou(boxes[one], boxes) > _IN_THE_WAY).any(axis=1)
        others = {*np.flatnonzero(overlaps).tolist()} - {one}
        if others:
            together |= {one, *others}
    return max(1, len(together))


def matches(truth: ObjectTruth, tracks: Tracks) -> NDArray[np.int64]:
    """Return the id of the track that each fish is matched with, `(n, T)`; 0: none.

    The assignment with the largest overlap in each frame, which prefers the pairs of the previous frame.
    """
    found = np.zeros((truth.objects, truth.frames), dtype=np.int64)
    held = np.zeros(truth.objects, dtype=np.int64)
    for t in range(truth.frames):
        here = tracks.get(t, {})
        if not here:
            continue
        ids = np.array(sorted(here))
        overlaps = np.nan_to_num(iou(truth.boxes[:, t, None], np.stack([here[k] for k in ids])[None]))
        stay = 0.5 * (held[:, None] == ids[None])
        fish, rows = assign_pairs(overlaps, _LEAST_IOU, stay)
        found[fish, t] = ids[rows]
        held[fish] = ids[rows]
    return found


def failures(truth: ObjectTruth, tracks: Tracks, fps: float) -> list[IdentityFailure]:
    """Return the failures of a clip, in order of time."""
    found = matches(truth, tracks)
    least, together = round(_LASTS_S * fps), _TOGETHER_S * fps
    changes = sorted(
        (frame, before, fish, old, new)
        for fish in range(truth.objects)
        for before, frame, old, new in _changes(found[fish], least)
    )
    groups: list[list[tuple[int, int, int, int, int]]] = []
    for change in changes:
        for group in groups:
            if any(
                abs(change[0] - it[0]) <= together and (change[2] == it[2] or {*change[3:]} & {*it[3:]})
                for it in group
            ):
                group.append(change)
                break
        else:
            groups.append([change])
    return [_failure(truth, group, fps) for group in groups]


def _changes(numbers: NDArray[np.int64], least: int) -> list[tuple[int, int, int, int]]:
    """Return (last frame before, first frame after, old, new) of the lasting id changes of a fish."""
    runs: list[list[int]] = []
    for t in np.flatnonzero(numbers):
        if runs and runs[-1][0] == numbers[t]:
            runs[-1][2] = int(t)
            runs[-1][3] += 1
        else:
            runs.append([int(numbers[t]), int(t), int(t), 1])
    lasting: list[list[int]] = []
    for run in runs:
        if run[3] < least:
            continue
        if lasting and lasting[-1][0] == run[0]:
            lasting[-1][2] = run[2]
        else:
            lasting.append(run)
    return [(old[2], new[1], old[0], new[0]) for old, new in pairwise(lasting)]


def _failure(
    truth: ObjectTruth, group: Sequence[tuple[int, int, int, int, int]], fps: float
) -> IdentityFailure:
    fish = sorted({change[2] for change in group})
    first, last = min(change[1] for change in group), max(change[0] for change in group)
    tracks = sorted({number for change in group for number in change[3:]})
    crossed = involved(truth, fish, first, last, fps)
    return IdentityFailure(min(change[0] for change in group), first, tuple(fish), tuple(tracks), crossed)
