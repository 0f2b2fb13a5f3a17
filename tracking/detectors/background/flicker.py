"""Flicker: foreground that changes all the time, such as leaves or water, says nothing about people.

Where many people walk, foreground changes, too, but less often: the next person is as far away as people keep
from each other. What flickers counts neither as foreground nor as background.
"""

from __future__ import annotations

import cv2
import numpy as np

from tracking.detectors.base import Image, Mask, Plane

# Change, in gray levels, between two checks.
_CHANGE = 14
# Seconds over which changes are averaged.
_AVERAGE_S = 6.0
# Changes per second of what is certainly flicker, of its margin, and of its end. In crowds that mill about,
# less than .05 % of the picture reaches the first.
_FLICKERS, _MARGIN, _CALM = 2.75, 2.25, 0.75
# Least area of what is certain, as a share of the picture, and side of the square that has to fit in, pixels.
_MIN_AREA, _SIDE = 0.0025, 5
# Seconds between two checks above which passers-by change as much at each of them.
_MAX_CHECK_S = 0.3


class FlickerFinder:
    """Finds flicker in one camera's foreground; `check_s` are the seconds between two checks.

    At low frame rates nothing is found.
    """

    def __init__(self, check_s: float) -> None:
        self._check_s = check_s
        self._share = min(check_s / _AVERAGE_S, 1.0) if check_s <= _MAX_CHECK_S else 0.0
        self._last: tuple[Mask, Mask] | None = None
        """Gray levels and foreground."""
        self._changes: Plane | None = None
        """`(H, W)`, per second."""
        self.mask: Mask | None = None
        """`(H, W)`, 255 where there is flicker; None: nowhere."""

    def check(self, image: Image, foreground: Mask) -> None:
        """Check a frame.

        Args:
            image: `(H, W, 3)`, at the background's light.
            foreground: `(H, W)`, 255 where it differs from the background, flicker included.
        """
        if not self._share:
            return
        gray = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        before, self._last = self._last, (gray, foreground)
        if before is None:
            return
        last, last_foreground = before
        changed = (cv2.absdiff(gray, last) >= _CHANGE) & ((foreground | last_foreground) > 0)
        if self._changes is None:
            self._changes = np.zeros(gray.shape, dtype=np.float32)
        per_second = changed.astype(np.float32) / np.float32(self._check_s)
        cv2.accumulateWeighted(per_second, self._changes, self._share)
        self.mask = self._find(self._changes)

    def _find(self, changes: Plane) -> Mask | None:
        margin, certain = changes >= _MARGIN, changes >= _FLICKERS
        if self.mask is not None:
            known = (changes >= _CALM) & (self.mask > 0)
            margin, certain = margin | known, certain | known
        min_area = _MIN_AREA * changes.size
        if np.count_nonzero(certain) < min_area:
            return None
        square = np.ones((_SIDE, _SIDE), dtype=np.uint8)
        closed = cv2.morphologyEx(margin.astype(np.uint8), cv2.MORPH_CLOSE, square)
        count, labels = cv2.connectedComponents(cv2.morphologyEx(closed, cv2.MORPH_OPEN, square))
        flickers = np.bincount(labels[certain], minlength=count) >= min_area
        flickers[0] = False
        if not flickers.any():
            return None
        return np.asarray(
            cv2.dilate(np.where(flickers[labels], 255, 0).astype(np.uint8), square), dtype=np.uint8
        )
