"""Histograms of the color channels in the parts of many boxes, by one integral image.

The picture is cut to where the boxes are. Each pixel's three levels are written as ones among zeros, one
after the other for all channels, so that a corner of a box is one row of sums in memory (Porikli, CVPR 2005).
"""

from __future__ import annotations

import cv2
import numpy as np

from tracking.boxes import Floats
from tracking.detectors.base import Image

LEVELS, CHANNELS = 8, 3
_CORE = np.array([0.6, 0.9])
"""Of a box's width and height, its middle: what is beside somebody is mostly background."""
_ONES = np.eye(LEVELS, dtype=np.uint8)


class PartHistograms:
    """What the parts of boxes in one part of a picture show."""

    def __init__(self, image: Image, around: Floats) -> None:
        """Sum the picture up inside `around`, `(4,)`: what a box has beyond it does not count."""
        high, wide = image.shape[:2]
        limits = np.array([wide, high, wide, high])
        self._area = np.clip([*np.floor(around[:2]), *np.ceil(around[2:])], 0, limits).astype(np.int64)
        left, top, right, bottom = self._area.tolist()
        levels = image[top : max(bottom, top), left : max(right, left)] // (256 // LEVELS)
        bins = _ONES[levels].reshape(*levels.shape[:2], CHANNELS * LEVELS)
        self._sums = np.zeros((levels.shape[0] + 1, levels.shape[1] + 1, CHANNELS * LEVELS), dtype=np.int32)
        if levels.size:
            cv2.integral(bins, self._sums, sdepth=cv2.CV_32S)

    def histograms(self, boxes: Floats) -> Floats:
        """Return the channel histograms of boxes `(..., 4)`, `(..., 3, 8)`; zeros outside the area."""
        left, top, right, bottom = self._area
        whole = np.clip(np.rint(boxes), [left, top] * 2, [max(right, left), max(bottom, top)] * 2)
        x0, y0, x1, y1 = np.moveaxis(whole.astype(np.int64) - [left, top, left, top], -1, 0)
        sums = self._sums
        counts = sums[y1, x1] - sums[y0, x1] - sums[y1, x0] + sums[y0, x0]
        pixels = np.maximum((x1 - x0) * (y1 - y0), 1)
        return np.asarray((counts / pixels[..., None]).reshape(*boxes.shape[:-1], CHANNELS, LEVELS))


def core_boxes(boxes: Floats) -> Floats:
    """Return the core of boxes `(..., 4)`, where most pixels are the person's."""
    middles = (boxes[..., :2] + boxes[..., 2:]) / 2
    halves = _CORE * (boxes[..., 2:] - boxes[..., :2]) / 2
    return np.concatenate([middles - halves, middles + halves], axis=-1)


def split_boxes(boxes: Floats, rows: int, columns: int) -> Floats:
    """Cut boxes `(..., 4)` into equal parts, row by row: `(..., rows * columns, 4)`."""
    xs = np.linspace(boxes[..., 0], boxes[..., 2], columns + 1, axis=-1)
    ys = np.linspace(boxes[..., 1], boxes[..., 3], rows + 1, axis=-1)
    row, column = (it.ravel() for it in np.indices((rows, columns)))
    return np.stack([xs[..., column], ys[..., row], xs[..., column + 1], ys[..., row + 1]], axis=-1)


def bhattacharyya_coefficient(found: Floats, known: Floats) -> Floats:
    """Compare histograms `(..., 8)`: their Bhattacharyya coefficients `(...)`, 1 for alike, 0 for unlike."""
    return np.asarray(np.sqrt(found * known).sum(axis=-1))
