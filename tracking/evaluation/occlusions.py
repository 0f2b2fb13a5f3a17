"""Occlusions in the ground truth, and whether identities survive them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import BOX_SIDES, areas, intersections
from tracking.evaluation.frame_matching import align_frames, match_frames
from tracking.evaluation.track_scores import DEFAULT_MIN_IOU
from tracking.motchallenge import MotRow

HIDDEN_BELOW = 0.25
"""Visible share below which a person is hidden."""
COVERED_ABOVE = 0.5
"""Share of a box covered by a nearer person above which its person is hidden, if visible shares are
unknown."""
_LEAST_SEEN = 3
"""Least visible frames before and after; two occlusions with fewer frames between them are one."""


@dataclass(frozen=True, slots=True)
class Occlusion:
    """One person, hidden from the frame `first` to the frame `last`."""

    person: int
    first: int
    last: int


def find_occlusions(truth: Iterable[MotRow], around: int) -> list[Occlusion]:
    """Find the occlusions after which a person reappears, from the truth's visible shares.

    If no visible share lies between 0 and 1, boxes count too: a person is hidden if a nearer one covers their
    box. Of two boxes the one that ends lower is nearer.

    Args:
        truth: rows of ground truth; those of confidence 0 do not count.
        around: frames before and after in which the person must be visible for a while.
    """
    seen: dict[int, dict[int, bool]] = {}
    for row, hidden in _hidden([row for row in truth if row.confidence != 0.0]):
        seen.setdefault(row.id, {})[row.frame] = not hidden
    return [found for person, frames in seen.items() for found in _of(person, frames, around)]


def identities_kept(
    found: Sequence[Occlusion],
    truth: Iterable[MotRow],
    tracks: Iterable[MotRow],
    around: int,
    least_iou: float = DEFAULT_MIN_IOU,
) -> list[bool]:
    """Return for each occlusion whether the person's track id is the same before and after it.

    The id is the one matched most often in the `around` frames before and after; a person without a match on
    either side did not keep it.
    """
    truth, tracks = list(truth), list(tracks)
    lined = align_frames(truth, tracks, least_iou)
    numbers: dict[int, dict[int, int]] = {}
    order = sorted({row.frame for row in (*truth, *tracks)})
    for number, frame, pairs in zip(order, lined, match_frames(lined, least_iou), strict=True):
        for person, track in np.argwhere(pairs).tolist():
            numbers.setdefault(int(frame.truth[person]), {})[number] = int(frame.tracks[track])
    return [_same(numbers.get(it.person, {}), it, around) for it in found]


def _same(numbers: dict[int, int], it: Occlusion, around: int) -> bool:
    before = _most(numbers, range(it.first - around, it.first))
    return before is not None and before == _most(numbers, range(it.last + 1, it.last + 1 + around))


def _most(numbers: dict[int, int], frames: range) -> int | None:
    counts = Counter(numbers[frame] for frame in frames if frame in numbers)
    return min(counts, key=lambda number: (-counts[number], number)) if counts else None


def _hidden(rows: Sequence[MotRow]) -> Iterable[tuple[MotRow, bool]]:
    """Yield each row with whether its person is hidden."""
    has_shares = any(0.0 < row.visible < 1.0 for row in rows)
    frames: dict[int, list[MotRow]] = {}
    for row in rows:
        frames.setdefault(row.frame, []).append(row)
    for there in frames.values():
        boxes = np.array([row.box for row in there], dtype=np.float64).reshape(-1, BOX_SIDES)
        nearer = boxes[None, :, 3] > boxes[:, None, 3]
        shared = np.where(nearer, intersections(boxes[:, None], boxes[None]), 0.0).max(axis=1, initial=0.0)
        shares = shared / np.maximum(areas(boxes), 1e-9)
        for row, share in zip(there, shares.tolist(), strict=True):
            covered = not has_shares and share > COVERED_ABOVE
            yield row, covered or 0.0 <= row.visible < HIDDEN_BELOW


def _of(person: int, frames: dict[int, bool], around: int) -> Iterable[Occlusion]:
    """Yield one person's occlusions from their visibility by frame."""
    hidden = sorted(frame for frame, seen in frames.items() if not seen)
    runs: list[list[int]] = []
    for frame in hidden:
        together = runs and sum(frames.get(it, False) for it in range(runs[-1][1] + 1, frame)) < _LEAST_SEEN
        if together:
            runs[-1][1] = frame
        else:
            runs.append([frame, frame])
    for first, last in runs:
        before = sum(frames.get(it, False) for it in range(first - around, first))
        after = sum(frames.get(it, False) for it in range(last + 1, last + 1 + around))
        if before >= _LEAST_SEEN and after >= _LEAST_SEEN:
            yield Occlusion(person, first, last)
