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
_MIN_VISIBLE_FRAMES = 3
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
        around: frames before and after in which the person must be visible for some frames.
    """
    visible: dict[int, dict[int, bool]] = {}
    for row, hidden in _hidden([row for row in truth if row.confidence != 0.0]):
        visible.setdefault(row.id, {})[row.frame] = not hidden
    return [found for person, frames in visible.items() for found in _occlusions_of(person, frames, around)]


def identities_kept(
    found: Sequence[Occlusion],
    truth: Iterable[MotRow],
    tracks: Iterable[MotRow],
    around: int,
    min_iou: float = DEFAULT_MIN_IOU,
) -> list[bool]:
    """Return for each occlusion whether the person's track id is the same before and after it.

    The id is the one matched most often in the `around` frames before and after; a person without a match on
    either side did not keep it.
    """
    truth, tracks = list(truth), list(tracks)
    aligned = align_frames(truth, tracks, min_iou)
    ids: dict[int, dict[int, int]] = {}
    order = sorted({row.frame for row in (*truth, *tracks)})
    for number, frame, pairs in zip(order, aligned, match_frames(aligned, min_iou), strict=True):
        for person, track in np.argwhere(pairs).tolist():
            ids.setdefault(int(frame.truth[person]), {})[number] = int(frame.tracks[track])
    return [_is_kept(ids.get(occlusion.person, {}), occlusion, around) for occlusion in found]


def _is_kept(ids: dict[int, int], occlusion: Occlusion, around: int) -> bool:
    before = _most_frequent(ids, range(occlusion.first - around, occlusion.first))
    after = _most_frequent(ids, range(occlusion.last + 1, occlusion.last + 1 + around))
    return before is not None and before == after


def _most_frequent(ids: dict[int, int], frames: range) -> int | None:
    counts = Counter(ids[frame] for frame in frames if frame in ids)
    return min(counts, key=lambda number: (-counts[number], number)) if counts else None


def _hidden(rows: Sequence[MotRow]) -> Iterable[tuple[MotRow, bool]]:
    """Yield each row with whether its person is hidden."""
    has_shares = any(0.0 < row.visible < 1.0 for row in rows)
    frames: dict[int, list[MotRow]] = {}
    for row in rows:
        frames.setdefault(row.frame, []).append(row)
    for people in frames.values():
        boxes = np.array([row.box for row in people], dtype=np.float64).reshape(-1, BOX_SIDES)
        nearer = boxes[None, :, 3] > boxes[:, None, 3]
        shared = np.where(nearer, intersections(boxes[:, None], boxes[None]), 0.0).max(axis=1, initial=0.0)
        shares = shared / np.maximum(areas(boxes), 1e-9)
        for row, share in zip(people, shares.tolist(), strict=True):
            covered = not has_shares and share > COVERED_ABOVE
            yield row, covered or 0.0 <= row.visible < HIDDEN_BELOW


def _occlusions_of(person: int, frames: dict[int, bool], around: int) -> Iterable[Occlusion]:
    """Yield one person's occlusions from their visibility by frame."""
    hidden = sorted(frame for frame, visible in frames.items() if not visible)
    runs: list[list[int]] = []
    for frame in hidden:
        continues = (
            runs
            and sum(frames.get(between, False) for between in range(runs[-1][1] + 1, frame))
            < _MIN_VISIBLE_FRAMES
        )
        if continues:
            runs[-1][1] = frame
        else:
            runs.append([frame, frame])
    for first, last in runs:
        before = sum(frames.get(frame, False) for frame in range(first - around, first))
        after = sum(frames.get(frame, False) for frame in range(last + 1, last + 1 + around))
        if before >= _MIN_VISIBLE_FRAMES and after >= _MIN_VISIBLE_FRAMES:
            yield Occlusion(person, first, last)
