"""Color histograms of many boxes of one image by integral images (Porikli, CVPR 2005)."""

from __future__ import annotations

import cv2
import numpy as np

from tracking.boxes import Floats
from tracking.detectors.base import Image

_SPLIT = 4
"""Levels of each of the three color channels: 64 joint bins."""
BINS = _SPLIT**3


class ColorIntegralImage:
    """Joint color histograms (64 bins) of boxes of one image, in constant time for each box."""

    def __init__(self, image: Image) -> None:
        levels = (image // (256 // _SPLIT)).astype(np.int32)
        codes = (levels[:, :, 0] * _SPLIT + levels[:, :, 1]) * _SPLIT + levels[:, :, 2]
        height, width = codes.shape
        # Only bins that have a pixel: about twenty of the 64.
        self._present = np.unique(codes)
        self._sums = np.empty((len(self._present), height + 1, width + 1), dtype=np.int32)
        for place, code in enumerate(self._present):
            self._sums[place] = cv2.integral((codes == code).astype(np.uint8), sdepth=cv2.CV_32S)
        self._limits = np.array([width, height, width, height])

    def histograms(self, boxes: Floats) -> Floats:
        """Return the color histograms of boxes `(..., 4)`, `(..., 64)`; zeros for a box outside the image."""
        clipped = np.clip(np.rint(boxes), 0, self._limits).astype(np.int64)
        left, top, right, bottom = np.moveaxis(clipped, -1, 0)
        sums = self._sums
        counts = sums[:, bottom, right] - sums[:, top, right] - sums[:, bottom, left] + sums[:, top, left]
        pixels = np.maximum((right - left) * (bottom - top), 1)
        shares = np.zeros((*boxes.shape[:-1], BINS))
        shares[..., self._present] = np.moveaxis(counts / pixels, 0, -1)
        return shares


class ColorIntegralCache:
    """Computes color integral images; the last one is cached."""

    def __init__(self) -> None:
        self._last: tuple[Image, ColorIntegralImage] | None = None

    def get(self, image: Image) -> ColorIntegralImage:
        """Return the integral image of an image."""
        if self._last is None or self._last[0] is not image:
            self._last = image, ColorIntegralImage(image)
        return self._last[1]


def upper_and_lower_halves(boxes: Floats) -> Floats:
    """Split boxes `(..., 4)` into their upper and lower halves, `(..., 2, 4)`."""
    middle = (boxes[..., 1] + boxes[..., 3]) / 2
    upper, lower = boxes.copy(), boxes.copy()
    upper[..., 3], lower[..., 1] = middle, middle
    return np.stack([upper, lower], axis=-2)


def color_distance(integral: ColorIntegralImage, boxes: Floats, colors: Floats) -> Floats:
    """Compare boxes `(..., 4)` with a target's colors `(2, 64)`, half by half.

    Returns:
        `(...)`, the mean of the halves' squared Bhattacharyya distances, 0 for identical to 1.
    """
    found = integral.histograms(upper_and_lower_halves(boxes))
    return np.asarray(1.0 - np.sqrt(found * colors).sum(axis=-1).mean(axis=-1))


LEVELS, CHANNELS = 8, 3
_CORE = np.array([0.6, 0.9])
"""Share of a box's width and height that is its core; outside it pixels are mostly background."""
_ONES = np.eye(LEVELS, dtype=np.uint8)


class ChannelIntegralImage:
    """Histograms of each color channel (3 x 8 bins) in boxes of one region of an image.

    Each pixel's three levels are ones among zeros, so that the sums at a corner of a box are one row in
    memory.
    """

    def __init__(self, image: Image, region: Floats) -> None:
        """Compute the integral image inside `region`, `(4,)`; pixels beyond it do not count."""
        height, width = image.shape[:2]
        limits = np.array([width, height, width, height])
        self._region = np.clip([*np.floor(region[:2]), *np.ceil(region[2:])], 0, limits).astype(np.int64)
        left, top, right, bottom = self._region.tolist()
        levels = image[top : max(bottom, top), left : max(right, left)] // (256 // LEVELS)
        bins = _ONES[levels].reshape(*levels.shape[:2], CHANNELS * LEVELS)
        self._sums = np.zeros((levels.shape[0] + 1, levels.shape[1] + 1, CHANNELS * LEVELS), dtype=np.int32)
        if levels.size:
            cv2.integral(bins, self._sums, sdepth=cv2.CV_32S)

    def histograms(self, boxes: Floats) -> Floats:
        """Return the channel histograms of boxes `(..., 4)`, `(..., 3, 8)`; zeros outside the region."""
        left, top, right, bottom = self._region
        clipped = np.clip(np.rint(boxes), [left, top] * 2, [max(right, left), max(bottom, top)] * 2)
        x0, y0, x1, y1 = np.moveaxis(clipped.astype(np.int64) - [left, top, left, top], -1, 0)
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
    row, column = (index.ravel() for index in np.indices((rows, columns)))
    return np.stack([xs[..., column], ys[..., row], xs[..., column + 1], ys[..., row + 1]], axis=-1)


def bhattacharyya_coefficient(found: Floats, known: Floats) -> Floats:
    """Return Bhattacharyya coefficients `(...)` of histograms `(..., 8)`: 1 identical, 0 disjoint."""
    return np.asarray(np.sqrt(found * known).sum(axis=-1))
