"""Prediction by mean shift on color back-projection (Comaniciu et al. 2000; Bradski 1998).

The hue-saturation histogram of the first box's core is divided by that of the surrounding ring, so that
colors shared with the background count little. The box moves to the mode of these colors; its size is
constant.
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
"""Sides of the core and of the surrounding box, as multiples of the box's."""
_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.5)
_FLOOR = 1e-3
_MIN_PROBABILITY = 0.05
"""Mean probability in a box below which the target counts as lost."""


@dataclass(slots=True)
class MeanShiftTarget:
    """State of one target: its back-projection histogram, 0 to 255, and its box."""

    colors: Plane
    box: Floats


class MeanShift:
    """Mean shift on the back-projection of each target's colors."""

    name = "mean-shift"
    uses_image = True

    def initialize(self, image: Image, box: Floats) -> MeanShiftTarget:
        """Create a target with the colors in its box."""
        hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
        core, ring = (_histogram(hsv, _scale_box(box, factor)) for factor in (_CORE, _RING))
        ratio = np.minimum(core / np.maximum(ring, _FLOOR), 1.0) * (core > _FLOOR)
        return MeanShiftTarget((255.0 * ratio).astype(np.float32), box.copy())

    def predict(self, image: Image | None, targets: Sequence[MeanShiftTarget]) -> Floats:
        """Move each target to the mode of its colors: `(N, 4)`, NaN where they are not found."""
        boxes = np.full((len(targets), BOX_SIDES), np.nan)
        if image is None:
            return boxes
        hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
        for row, target in enumerate(targets):
            probability = cv2.calcBackProject([hsv], [0, 1], target.colors, _RANGES, 1)
            left, top = (round(edge) for edge in target.box[:2])
            width, height = (max(round(side), 1) for side in target.box[2:] - target.box[:2])
            _, (x, y, width, height) = cv2.meanShift(probability, (left, top, width, height), _STOP)
            inside = probability[max(y, 0) : y + height, max(x, 0) : x + width]
            if inside.size and float(inside.mean()) >= 255 * _MIN_PROBABILITY:
                size = target.box[2:] - target.box[:2]
                middle = np.array([x + width / 2, y + height / 2])
                target.box = boxes[row] = np.concatenate([middle - size / 2, middle + size / 2])
        return boxes

    def update(self, target: MeanShiftTarget, _detection: Floats) -> Floats:
        """Return the target's box; detections are not used."""
        return target.box


def _scale_box(box: Floats, factor: float) -> Floats:
    middle, half = (box[:2] + box[2:]) / 2, factor * (box[2:] - box[:2]) / 2
    return np.asarray(np.concatenate([middle - half, middle + half]))


def _histogram(hsv: cv2.typing.MatLike, box: Floats) -> Floats:
    """Return the hue-saturation histogram of a box, `(16, 16)`; zeros outside the image."""
    height, width = hsv.shape[:2]
    left, top, right, bottom = np.clip(np.rint(box), 0, [width, height, width, height]).astype(int).tolist()
    if left >= right or top >= bottom:
        return np.zeros(_BINS)
    counts = cv2.calcHist([hsv[top:bottom, left:right]], [0, 1], None, list(_BINS), _RANGES)
    return np.asarray(np.asarray(counts, dtype=np.float64) / ((right - left) * (bottom - top)))
