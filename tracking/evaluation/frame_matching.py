"""Overlaps and matches of ground truth and tracks, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.assignment import assign_pairs
from tracking.boxes import BOX_SIDES, Floats, iou
from tracking.motchallenge import MotRow

Ids = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class FrameSimilarity:
    """Ground truth and tracks of one frame, and their overlaps.

    Attributes:
        truth: `(T,)` ids of the people in the frame.
        tracks: `(R,)` ids of the tracks in the frame.
        similarity: `(T, R)` overlap (IoU) of their boxes, in [0, 1].
    """

    truth: Ids
    tracks: Ids
    similarity: Floats


def align_frames(
    truth: Iterable[MotRow], tracks: Iterable[MotRow], ignored_min_iou: float
) -> list[FrameSimilarity]:
    """Return the overlaps of truth and tracks frame by frame, for frames with any, in order.

    Truth of confidence 0 does not count: such a person need not be detected, and a track matched with one, at
    an overlap of at least `ignored_min_iou`, is left out instead of counted as a false positive, as in
    MOTChallenge.

    Raises:
        ValueError: an id occurs twice in one frame.
    """
    truth_rows, track_rows = _by_frame(truth, "ground truth"), _by_frame(tracks, "tracks")
    return [
        _frame(truth_rows.get(number, []), track_rows.get(number, []), ignored_min_iou)
        for number in sorted(truth_rows.keys() | track_rows.keys())
    ]


def _by_frame(rows: Iterable[MotRow], what: str) -> dict[int, list[MotRow]]:
    frames: dict[int, dict[int, MotRow]] = {}
    for row in rows:
        frame = frames.setdefault(row.frame, {})
        if row.id in frame:
            hint = "; these are detections, not tracks" if row.id == -1 else ""
            raise ValueError(f"{what}: frame {row.frame} has id {row.id} twice{hint}")
        frame[row.id] = row
    return {number: list(frame.values()) for number, frame in frames.items()}


def _frame(truth: Sequence[MotRow], tracks: Sequence[MotRow], ignored_min_iou: float) -> FrameSimilarity:
    counts = np.array([row.confidence != 0.0 for row in truth], dtype=bool)
    similarity = iou(_boxes(truth)[:, None], _boxes(tracks)[None])
    kept = np.ones(len(tracks), dtype=bool)
    if not counts.all():
        people, results = assign_pairs(similarity, ignored_min_iou)
        kept[results[~counts[people]]] = False
    return FrameSimilarity(_ids(truth)[counts], _ids(tracks)[kept], similarity[np.ix_(counts, kept)])


def _ids(rows: Sequence[MotRow]) -> Ids:
    return np.array([row.id for row in rows], dtype=np.int64)


def _boxes(rows: Sequence[MotRow]) -> Floats:
    return np.array([row.box for row in rows], dtype=np.float64).reshape(-1, BOX_SIDES)


_KEEP_BONUS = 1000.0
"""Bonus for keeping a match: more than all overlaps of a frame together."""


def match_frames(frames: Iterable[FrameSimilarity], min_iou: float) -> Iterator[NDArray[np.bool_]]:
    """Yield for each frame which person is matched with which track, `(T, R)`."""
    before: dict[int, int] = {}
    for frame in frames:
        pairs = np.zeros(frame.similarity.shape, dtype=bool)
        if pairs.size:
            # NaN equals no track id.
            previous = np.array([before.get(person, np.nan) for person in frame.truth.tolist()])
            bonus = _KEEP_BONUS * (previous[:, None] == frame.tracks[None])
            rows, columns = assign_pairs(frame.similarity, min_iou, bonus)
            pairs[rows, columns] = True
            before = dict(zip(frame.truth[rows].tolist(), frame.tracks[columns].tolist(), strict=True))
        yield pairs
