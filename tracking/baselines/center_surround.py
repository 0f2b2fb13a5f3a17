"""How much more a window holds of something than the ring around it, for many windows (Todor 2009, ch. 9)."""

from __future__ import annotations

import cv2
import numpy as np

from tracking.boxes import Floats
from tracking.detectors.base import Plane

RING = 0.5
"""Pixels of the ring for each of the window's."""


class WindowSums:
    """Several maps' sums, by an integral image: any window costs as much as any other (Viola, Jones 2001)."""

    def __init__(self, values: Plane, left: float, top: float) -> None:
        """Sum N maps `(H, W, N)` up, the first pixel of which is at `left`, `top` of the picture."""
        high, wide, maps = values.shape
        self._corner, self._limits = np.array([left, top] * 2), np.array([wide, high, wide, high])
        self._sums = np.zeros((high + 1, wide + 1, maps))
        if values.size:
            self._sums = cv2.integral(values, sdepth=cv2.CV_64F).reshape(self._sums.shape)

    def contrasts(self, windows: Floats) -> Floats:
        """Give the mean in windows `(..., 4)` less the mean in the rings around them, `(..., N)`."""
        inside, pixels = self._summed(windows)
        around, all_pixels = self._summed(ringed(windows))
        ring = (around - inside) / np.maximum(all_pixels - pixels, 1.0)
        return np.asarray(inside / np.maximum(pixels, 1.0) - ring)

    def _summed(self, windows: Floats) -> tuple[Floats, Floats]:
        """Give the sums over windows, `(..., N)`, and of how many pixels, `(..., 1)`."""
        whole = np.clip(np.rint(windows) - self._corner, 0, self._limits).astype(np.int64)
        left, top, right, bottom = np.moveaxis(whole, -1, 0)
        sums = self._sums
        totals = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
        return totals, ((right - left) * (bottom - top)).astype(np.float64)[..., None]


def ringed(windows: Floats) -> Floats:
    """Give windows `(..., 4)` with their rings."""
    sides = windows[..., 2:] - windows[..., :2]
    margin = sides * (np.sqrt(1.0 + RING) - 1.0) / 2
    return np.concatenate([windows[..., :2] - margin, windows[..., 2:] + margin], axis=-1)
