"""Color histograms of many boxes of one image by integral images (Porikli, CVPR 2005)."""

from __future__ import annotations

import cv2
import numpy as np

from tracking.boxes import Floats
from tracking.detectors.base import Image

_SPLIT = 4
"""Levels of each of the three color channels: 64 bins."""
BINS = _SPLIT**3


class ColorIntegralImage:
    """One picture's colors. A histogram of any box costs as much as of any other."""

    def __init__(self, image: Image) -> None:
        levels = (image // (256 // _SPLIT)).astype(np.int32)
        codes = (levels[:, :, 0] * _SPLIT + levels[:, :, 1]) * _SPLIT + levels[:, :, 2]
        high, wide = codes.shape
        # Bins that no pixel has are not summed: a picture holds some twenty of the 64.
        self._present = np.unique(codes)
        self._sums = np.empty((len(self._present), high + 1, wide + 1), dtype=np.int32)
        for place, code in enumerate(self._present):
            self._sums[place] = cv2.integral((codes == code).astype(np.uint8), sdepth=cv2.CV_32S)
        self._limits = np.array([wide, high, wide, high])

    def histograms(self, boxes: Floats) -> Floats:
        """Return the color histograms of boxes `(..., 4)`, `(..., 64)`; zeros for a box outside the image."""
        whole = np.clip(np.rint(boxes), 0, self._limits).astype(np.int64)
        left, top, right, bottom = np.moveaxis(whole, -1, 0)
        sums = self._sums
        counts = sums[:, bottom, right] - sums[:, top, right] - sums[:, bottom, left] + sums[:, top, left]
        pixels = np.maximum((right - left) * (bottom - top), 1)
        shares = np.zeros((*boxes.shape[:-1], BINS))
        shares[..., self._present] = np.moveaxis(counts / pixels, 0, -1)
        return shares


class ColorIntegralCache:
    """Sums pictures' colors; the integral image of the last picture is cached."""

    def __init__(self) -> None:
        self._last: tuple[Image, ColorIntegralImage] | None = None

    def get(self, image: Image) -> ColorIntegralImage:
        """Return the integral image of a picture, computed once for the last one."""
        if self._last is None or self._last[0] is not image:
            self._last = image, ColorIntegralImage(image)
        return self._last[1]


def upper_and_lower_halves(boxes: Floats) -> Floats:
    """Split boxes `(..., 4)` into their upper and lower halves, `(..., 2, 4)`."""
    middle = (boxes[..., 1] + boxes[..., 3]) / 2
    upper, lower = boxes.copy(), boxes.copy()
    upper[..., 3], lower[..., 1] = middle, middle
    return np.stack([upper, lower], axis=-2)


def color_distance(field: ColorIntegralImage, boxes: Floats, colors: Floats) -> Floats:
    """Compare boxes `(..., 4)` with somebody's colors `(2, 64)`, half by half.

    Returns:
        `(...)`, the mean of the halves' squared Bhattacharyya distances: 0 for alike to 1.
    """
    found = field.histograms(upper_and_lower_halves(boxes))
    return np.asarray(1.0 - np.sqrt(found * colors).sum(axis=-1).mean(axis=-1))
