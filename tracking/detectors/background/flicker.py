"""Flicker: foreground that changes all the time, such as leaves or water, says nothing about people.

Where many people walk, foreground changes often, too, but they leave gaps. What keeps changing over several
seconds, and covers more than a spot, counts neither as foreground nor as background.
"""

from __future__ import annotations

import cv2
import numpy as np

from tracking.detectors.base import Image, Mask, Plane

# Change, in gray levels, between two checks.
_CHANGE = 14
# Seconds over which changes are averaged; the share of checks with changes that is flicker, and that ends it.
_AVERAGE_S, _FLICKERS, _CALM = 6.0, 0.3, 0.15
# Least area of flicker, as a share of the picture, and the side of the square that has to fit in, in pixels.
_MIN_AREA, _SIDE = 0.01, 5


class FlickerFinder:
    """Finds flicker in one camera's foreground; `check_s` are the seconds between two checks."""

    def __init__(self, check_s: float) -> None:
        self._share = min(check_s / _AVERAGE_S, 1.0)
        self._last: Mask | None = None
        self._changes: Plane | None = None
        self.mask: Mask | None = None
        """`(H, W)`, 255 where there is flicker; None: nowhere."""

    def check(self, image: Image, foreground: Mask) -> None:
        """Check a frame.

        Args:
            image: `(H, W, 3)`, at the background's light.
            foreground: `(H, W)`, 255 where it differs from the background, flicker included.
        """
        gray = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        last, self._last = self._last, gray
        if last is None:
            return
        changed = (cv2.absdiff(gray, last) >= _CHANGE) & (foreground > 0)
        if self._changes is None:
            self._changes = np.zeros(gray.shape, dtype=np.float32)
        cv2.accumulateWeighted(changed.astype(np.float32), self._changes, self._share)
        self.mask = self._find(self._changes)

    def _find(self, changes: Plane) -> Mask | None:
        flickers = changes >= _FLICKERS
        if self.mask is not None:
            flickers |= (changes >= _CALM) & (self.mask > 0)
        if np.count_nonzero(flickers) < _MIN_AREA * flickers.size:
            return None
        square = np.ones((_SIDE, _SIDE), dtype=np.uint8)
        closed = cv2.morphologyEx(flickers.astype(np.uint8), cv2.MORPH_CLOSE, square)
        regions = cv2.morphologyEx(closed, cv2.MORPH_OPEN, square)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(regions)
        large = stats[:, cv2.CC_STAT_AREA] >= _MIN_AREA * regions.size
        large[0] = False
        if not large.any():
            return None
        return np.asarray(
            cv2.dilate(np.where(large[labels], 255, 0).astype(np.uint8), square), dtype=np.uint8
        )
