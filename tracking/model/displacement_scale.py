"""How far boxes move between two frames: people walk, and boxes jitter, those of some detectors more."""

from __future__ import annotations

import numpy as np

from tracking.boxes import corner_distance_in_heights, iou
from tracking.model.settings import walking_displacement
from tracking.types import Detections

_MIN_SCORE = 0.5
_MIN_OVERLAP = 0.2
"""Overlap (IoU) at least of two boxes of one person in consecutive frames."""
_EXPECTED = 20.0
"""Displacements that the expectation counts for."""
_MEMORY = 1000.0
"""Displacements after which older ones count less."""


class DisplacementScale:
    """Measures the mean displacement of boxes between consecutive frames, in mean heights of the two.

    Boxes of two frames that overlap each other best are taken for one person's: no track is needed, so that
    the measure does not depend on what it is used for. Whoever walks too fast for the frame rate overlaps
    nothing; therefore it is never less than what people who walk are expected to move.
    """

    def __init__(self, fps: float) -> None:
        self._expected = walking_displacement(fps)
        self._sum, self._count = _EXPECTED * self._expected, _EXPECTED

    @property
    def ordinary(self) -> float:
        """The mean displacement, or the expected one if that is larger."""
        return max(self._expected, self._sum / self._count)

    def add(self, before: Detections, after: Detections) -> None:
        """Add the detections of two consecutive frames."""
        first, second = (found.boxes[found.scores >= _MIN_SCORE] for found in (before, after))
        if not len(first) or not len(second):
            return
        overlaps = iou(first[:, None], second[None])
        best = overlaps.argmax(axis=1)
        rows = np.arange(len(first))
        is_mutual = (overlaps.argmax(axis=0)[best] == rows) & (overlaps[rows, best] >= _MIN_OVERLAP)
        moved = corner_distance_in_heights(first[is_mutual], second[best[is_mutual]])
        self._sum, self._count = self._sum + float(moved.sum()), self._count + len(moved)
        if self._count > _MEMORY:
            self._sum, self._count = self._sum * _MEMORY / self._count, _MEMORY
