"""Prediction by mean shift on color back-projection (Comaniciu et al. 2000; Bradski 1998).

A histogram over hue and saturation is taken of the core of the first box, divided by that of the ring
around it: colors that the background shares count little. The box moves to the densest pixels of these
colors. It keeps its size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.detectors.base import Image, Plane

_BINS = (16, 16)
_RANGES = [0, 180, 0, 256]
_CORE, _RING = 0.6, 1.6
"""Of a box, its middle; and what surrounds it, as a multiple of its sides."""
_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.5)
_FLOOR = 1e-3
_MIN_PROBABILITY = 0.05
"""Mean probability in a box below which nobody of these colors is there."""


@dataclass(slots=True)
class MeanShiftTarget:
    """State of one target: its back-projection histogram, 0 to 255, and its box."""

    colors: Plane
    box: Floats


class MeanShift:
    """Climbs to the place of somebody's colors."""

    name = "mean-shift"
    uses_image = True

    def initialize(self, image: Image, box: Floats) -> MeanShiftTarget:
        """Create a target with the colors in its box."""
        space = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
        mine, around = (_histogram(space, _scale_box(box, share)) for share in (_CORE, _RING))
        ratio = np.minimum(mine / np.maximum(around, _FLOOR), 1.0) * (mine > _FLOOR)
        return MeanShiftTarget((255.0 * ratio).astype(np.float32), box.copy())

    def predict(self, image: Image | None, objects: Sequence[MeanShiftTarget]) -> Floats:
        """Move each target to the mode of its colors: `(N, 4)`, NaN where they are not found."""
        boxes = np.full((len(objects), BOX_SIDES), np.nan)
        if image is None:
            return boxes
        space = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
        for row, item in enumerate(objects):
            likely = cv2.calcBackProject([space], [0, 1], item.colors, _RANGES, 1)
            left, top = (round(it) for it in item.box[:2])
            wide, tall = (max(round(it), 1) for it in item.box[2:] - item.box[:2])
            _, (x, y, width, height) = cv2.meanShift(likely, (left, top, wide, tall), _STOP)
            inside = likely[max(y, 0) : y + height, max(x, 0) : x + width]
            if inside.size and float(inside.mean()) >= 255 * _MIN_PROBABILITY:
                size = item.box[2:] - item.box[:2]
                middle = np.array([x + width / 2, y + height / 2])
                item.box = boxes[row] = np.concatenate([middle - size / 2, middle + size / 2])
        return boxes

    def update(self, known: MeanShiftTarget, box: Floats) -> Floats:  # noqa: ARG002 — the image alone decides
        """Return the target's own box: a detection does not move it."""
        return known.box


def _scale_box(box: Floats, share: float) -> Floats:
    middle, half = (box[:2] + box[2:]) / 2, share * (box[2:] - box[:2]) / 2
    return np.asarray(np.concatenate([middle - half, middle + half]))


def _histogram(space: cv2.typing.MatLike, box: Floats) -> Floats:
    """Return the hue-saturation histogram of a box, `(16, 16)`; zeros outside the image."""
    high, wide = space.shape[:2]
    left, top, right, bottom = np.clip(np.rint(box), 0, [wide, high, wide, high]).astype(int).tolist()
    if left >= right or top >= bottom:
        return np.zeros(_BINS)
    counts = cv2.calcHist([space[top:bottom, left:right]], [0, 1], None, list(_BINS), _RANGES)
    return np.asarray(np.asarray(counts, dtype=np.float64) / ((right - left) * (bottom - top)))
