"""Recognizes a frozen picture: one that changes less than the noise of that camera ever did.

A sensor's noise changes some pixels everywhere. Cameras whose noise does not reach the picture (drawn ones,
or those with an encoder that repeats what hardly changes) are not judged: an empty room would look frozen.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import cv2
import numpy as np

from tracking.detectors.base import Image

# Pixels compared along the longer side, and the cells along both sides whose median counts: most of a picture
# is background, and motion elsewhere does not matter.
_SAMPLES = 96
_CELLS = (8, 6)
# Seconds between the pictures that are compared; over which the median is taken; and of pictures that are
# needed to know the camera.
_APART_S, _WINDOW_S, _KNOWN_S = 0.5, 3.0, 12.0
# Share of changed pixels below which a picture stands still, and that a camera's noise must have exceeded.
_STILL, _NOISE = 0.004, 0.04


def forget_before(timed: deque[Any], seconds: float) -> None:
    """Drop the oldest of some tuples that begin with a time, except the last one up to a time."""
    while len(timed) > 1 and timed[1][0] <= seconds:
        timed.popleft()


class StillnessMonitor:
    """Compares the pictures of one camera with those of half a second before."""

    def __init__(self) -> None:
        self._pictures: deque[tuple[float, Image]] = deque()
        self._changes: deque[tuple[float, float, float]] = deque()
        """Times, and shares of the pixels that have changed: of all, and of the median cell."""
        self._noises: deque[tuple[float, float]] = deque()
        self._quietest = 1.0
        self._known_s = 0.0
        self.repeats = False
        """Whether the last picture is that of half a second before: it does not show what happens now."""

    def is_frozen(self, image: Image, seconds: float, elapsed: float) -> bool:
        """Return whether pictures have stood still for some seconds up to this one.

        Args:
            image: `(H, W, 3)`.
            seconds: its time.
            elapsed: since the picture before, 0 for the first.
        """
        step = max(max(image.shape[:2]) // _SAMPLES, 1)
        pixels = np.ascontiguousarray(image[step // 2 :: step, step // 2 :: step, 1])
        self._pictures.append((seconds, pixels))
        forget_before(self._pictures, seconds - _APART_S)
        before, other = self._pictures[0]
        if before > seconds - _APART_S:
            return False
        changed = (cv2.absdiff(pixels, other) > 0).astype(np.float32)
        is_known = self._quietest > _NOISE and self._known_s >= _KNOWN_S
        self.repeats = is_known and float(changed.mean()) < _STILL
        cells = cv2.resize(changed, _CELLS, interpolation=cv2.INTER_AREA)
        self._changes.append((seconds, float(changed.mean()), float(np.median(cells))))
        forget_before(self._changes, seconds - _WINDOW_S)
        if self._changes[0][0] > seconds - _WINDOW_S:
            return False
        _, change, noise = np.median(self._changes, axis=0).tolist()
        if change < _STILL and is_known:
            self._noises.clear()
            return True
        self._known_s += elapsed
        # A picture that is about to freeze says nothing about the camera.
        self._noises.append((seconds, noise))
        while self._noises[0][0] <= seconds - _WINDOW_S:
            self._quietest = min(self._quietest, self._noises.popleft()[1])
        return False
