"""Scores of detections in pictures: recall, precision, average precision, and calibration of their scores."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import BOX_SIDES, iou
from tracking.evaluation.track_scores import DEFAULT_MIN_IOU
from tracking.motchallenge import MotRow

Floats = NDArray[np.float64]
_BINS = 10


@dataclass(frozen=True, slots=True, eq=False)
class ScoredBoxes:
    """Detections and whether each is right.

    Attributes:
        scores: (N,) of the detections, highest first.
        right: (N,) whether a detection matches a person that none of higher score in its frame matches.
        people: number of people's boxes in the truth.
    """

    scores: Floats
    right: NDArray[np.bool_]
    people: int

    @classmethod
    def of(
        cls, truth: Iterable[MotRow], boxes: Iterable[MotRow], min_iou: float = DEFAULT_MIN_IOU
    ) -> ScoredBoxes:
        """Match the detections of one camera with its truth, those of high scores first.

        Detections on people whose row has the confidence 0 do not count, as these people do not.
        """
        people = _by_frame(truth)
        scores: list[float] = []
        right: list[bool] = []
        for frame, found in _by_frame(boxes).items():
            for score, is_right in _matched(people.get(frame, []), found, min_iou):
                scores.append(score)
                right.append(is_right)
        counted = sum(row.confidence != 0.0 for rows in people.values() for row in rows)
        return cls._sorted(np.array(scores), np.array(right, dtype=bool), counted)

    @classmethod
    def joined(cls, parts: Sequence[ScoredBoxes]) -> ScoredBoxes:
        """Return the detections of several cameras or recordings together."""
        scores = np.concatenate([part.scores for part in parts])
        right = np.concatenate([part.right for part in parts])
        return cls._sorted(scores, right, sum(part.people for part in parts))

    @classmethod
    def _sorted(cls, scores: Floats, right: NDArray[np.bool_], people: int) -> ScoredBoxes:
        order = np.argsort(-scores, kind="stable")
        return cls(scores[order], right[order], people)

    def recall(self, min_score: float = 0.0) -> float:
        """Return the share of people that detections of at least a score match."""
        return float(self.right[self.scores >= min_score].sum()) / max(self.people, 1)

    def precision(self, min_score: float = 0.0) -> float:
        """Return the share of the detections of at least a score that are right; 1 without detections."""
        kept = self.right[self.scores >= min_score]
        return float(kept.mean()) if len(kept) else 1.0

    @property
    def average_precision(self) -> float:
        """The area under precision over recall, precision made monotone (Everingham et al., IJCV 2010)."""
        if not len(self.scores):
            return 0.0
        correct = np.cumsum(self.right)
        precision = correct / np.arange(1, len(correct) + 1)
        envelope = np.maximum.accumulate(precision[::-1])[::-1]
        return float(envelope[self.right].sum()) / max(self.people, 1)

    @property
    def calibration_error(self) -> float:
        """The expected calibration error: |score - share of right ones|, in ten bins of scores.

        Guo et al., On calibration of modern neural networks, ICML 2017.
        """
        if not len(self.scores):
            return 0.0
        bins = np.minimum((np.clip(self.scores, 0.0, 1.0) * _BINS).astype(np.int64), _BINS - 1)
        gaps = np.bincount(bins, self.right - self.scores, _BINS)
        return float(np.abs(gaps).sum()) / len(self.scores)


def _by_frame(rows: Iterable[MotRow]) -> dict[int, list[MotRow]]:
    frames: dict[int, list[MotRow]] = {}
    for row in rows:
        frames.setdefault(row.frame, []).append(row)
    return frames


def _matched(people: list[MotRow], found: list[MotRow], min_iou: float) -> Iterable[tuple[float, bool]]:
    """Yield the score of each detection of a frame that counts, and whether it is right."""
    counts = np.array([row.confidence != 0.0 for row in people], dtype=bool)
    found = sorted(found, key=lambda row: -row.confidence)
    overlaps = iou(_boxes(found)[:, None], _boxes(people)[None])
    free = counts.copy()
    for row, overlap in zip(found, overlaps, strict=True):
        best = int(np.argmax(np.where(free, overlap, -1.0))) if free.any() else -1
        if best >= 0 and overlap[best] >= min_iou:
            free[best] = False
            yield row.confidence, True
        elif not (overlap[~counts] >= min_iou).any():
            yield row.confidence, False


def _boxes(rows: Sequence[MotRow]) -> Floats:
    return np.array([row.box for row in rows], dtype=np.float64).reshape(-1, BOX_SIDES)
