"""Letterboxing: scales a camera's picture to the site's size, and maps coordinates both ways."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]


class Letterbox:
    """Scales a picture to the site's size with its aspect ratio; the rest stays black.

    Sizes are (width, height) in pixels.
    """

    def __init__(self, own: tuple[int, int], site: tuple[int, int]) -> None:
        self.own, self._site = own, site
        self._exact = own == site
        self.scale = min(site[0] / own[0], site[1] / own[1])
        self._inner = (
            min(site[0], max(1, round(own[0] * self.scale))),
            min(site[1], max(1, round(own[1] * self.scale))),
        )
        self._left = (site[0] - self._inner[0]) // 2
        self._top = (site[1] - self._inner[1]) // 2

    @property
    def size(self) -> tuple[int, int]:
        """The site's picture size."""
        return self._site

    def image(self, own: Image) -> Image:
        """Return the site-sized picture of a camera's own picture."""
        if self._exact and own.shape[1::-1] == self._site:
            return own
        shrinking = self.scale < 1
        scaled = cv2.resize(own, self._inner, interpolation=cv2.INTER_AREA if shrinking else cv2.INTER_LINEAR)
        if self._inner == self._site:
            return np.asarray(scaled, dtype=np.uint8)
        canvas = np.zeros((self._site[1], self._site[0], 3), dtype=np.uint8)
        canvas[self._top : self._top + self._inner[1], self._left : self._left + self._inner[0]] = scaled
        return canvas

    def to_site(self, points: Floats) -> Floats:
        """Map points ``(…, 2)`` from the camera's own picture into the site's."""
        return points * self.scale + (self._left, self._top)

    def to_own(self, points: Floats) -> Floats:
        """Map points ``(…, 2)`` from the site's picture into the camera's own."""
        return (points - (self._left, self._top)) / self.scale

    def boxes_to_own(self, boxes: Floats) -> Floats:
        """Map boxes ``(N, 4)`` from the site's picture into the camera's own."""
        return (boxes - (self._left, self._top, self._left, self._top)) / self.scale

    def boxes_to_site(self, boxes: Floats) -> Floats:
        """Map boxes ``(N, 4)`` from the camera's own picture into the site's."""
        return boxes * self.scale + (self._left, self._top, self._left, self._top)
