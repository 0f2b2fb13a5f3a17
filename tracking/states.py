"""One object's states in a window, as boxes and as a confidence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from tracking.boxes import BOX_SIDES, Floats
from tracking.detections import Detections
from tracking.solvers.base import OCCLUDED


def boxes_of(states: npt.NDArray[np.int64], frames: Sequence[Detections]) -> Floats:
    """Give the boxes of states `(F,)`, `(F, 4)` pixels, NaN where the object is hidden."""
    boxes = np.full((len(frames), BOX_SIDES), np.nan)
    for m, state in enumerate(states):
        if state != OCCLUDED:
            boxes[m] = frames[m].boxes[state]
    return boxes


def confidence_of(states: npt.NDArray[np.int64], frames: Sequence[Detections]) -> float:
    """Give the mean score of the boxes of states `(F,)`, 0 where the object is hidden; in [0, 1]."""
    scores = [float(frames[m].scores[state]) for m, state in enumerate(states) if state != OCCLUDED]
    return sum(scores) / len(frames)
