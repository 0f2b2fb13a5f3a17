"""The observations of a window as padded arrays, so that costs are computed for all frames at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import BOX_SIDES, Floats
from tracking.types import Detections


@dataclass(frozen=True, slots=True, eq=False)
class ObservationArrays:
    """P sets of observations over M frames, padded to the K of the fullest frame.

    P is 1 if all objects share the observations, otherwise the number of objects.

    Attributes:
        boxes: (P, M, K, 4) pixels; padding is zero.
        scores: (P, M, K); padding is zero.
        histograms: (P, M, K, B); padding is zero.
        present: (P, M, K) bool, False on padding.
    """

    boxes: Floats
    scores: Floats
    histograms: Floats
    present: NDArray[np.bool_]


def stack_observations(sets: Sequence[Sequence[Detections]]) -> ObservationArrays:
    """Pad the sets of frames into arrays.

    Raises:
        ValueError: there is no frame, sets differ in length, or histograms have different numbers of bins.
    """
    lengths = {len(frames) for frames in sets}
    if lengths == {0} or not sets:
        raise ValueError("a window needs at least one frame")
    if len(lengths) > 1:
        raise ValueError(f"all objects need the same number of frames, not {sorted(lengths)}")
    shape = (len(sets), lengths.pop())
    width = max(len(detections) for frames in sets for detections in frames)
    bins = _common_bin_count(sets)
    boxes = np.zeros((*shape, width, BOX_SIDES))
    scores = np.zeros((*shape, width))
    appearance = np.zeros((*shape, width, bins))
    present = np.zeros((*shape, width), dtype=np.bool_)
    for p, frames in enumerate(sets):
        for m, detections in enumerate(frames):
            count = len(detections)
            if count:
                boxes[p, m, :count] = detections.boxes
                scores[p, m, :count] = detections.scores
                appearance[p, m, :count] = detections.histograms
                present[p, m, :count] = True
    return ObservationArrays(boxes, scores, appearance, present)


def _common_bin_count(sets: Sequence[Sequence[Detections]]) -> int:
    """Return the number of bins that all frames with observations have."""
    bins = {detections.histograms.shape[1] for frames in sets for detections in frames if len(detections)}
    if len(bins) > 1:
        raise ValueError(f"all histograms of a window need the same number of bins, not {sorted(bins)}")
    return bins.pop() if bins else 0
