"""Letterboxing: scales a camera's image to the site's size, and maps coordinates both ways."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tracking.image_scaling import scale_image

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]


class Letterbox:
    """Scales an image to the site's size, keeping its aspect ratio, with black bars.

    Sizes are (width, height) in pixels.
    """

    def __init__(self, camera: tuple[int, int], site: tuple[int, int]) -> None:
        self.camera_size, self.site_size = camera, site
        self.scale = min(site[0] / camera[0], site[1] / camera[1])
        self._inner = (
            min(site[0], max(1, round(camera[0] * self.scale))),
            min(site[1], max(1, round(camera[1] * self.scale))),
        )
        self._left = (site[0] - self._inner[0]) // 2
        self._top = (site[1] - self._inner[1]) // 2

    @property
    def content(self) -> tuple[int, int, int, int]:
        """Left, top, width and height of the camera's image in the site's."""
        return self._left, self._top, *self._inner

    @property
    def homography(self) -> Floats:
        """From pixels of the camera's image to the site's, (3, 3)."""
        return np.array([[self.scale, 0.0, self._left], [0.0, self.scale, self._top], [0.0, 0.0, 1.0]])

    def image(self, image: Image) -> Image:
        """Return a camera's image at the site's size."""
        scaled = scale_image(image, self._inner)
        if self._inner == self.site_size:
            return scaled
        canvas = np.zeros((self.site_size[1], self.site_size[0], 3), dtype=np.uint8)
        canvas[self._top : self._top + self._inner[1], self._left : self._left + self._inner[0]] = scaled
        return canvas

    def camera_to_site(self, points: Floats) -> Floats:
        """Map points ``(…, 2)`` from the camera's image to the site's."""
        return points * self.scale + (self._left, self._top)

    def site_to_camera(self, points: Floats) -> Floats:
        """Map points ``(…, 2)`` from the site's image to the camera's."""
        return (points - (self._left, self._top)) / self.scale

    def boxes_site_to_camera(self, boxes: Floats) -> Floats:
        """Map boxes ``(N, 4)`` from the site's image to the camera's."""
        return (boxes - (self._left, self._top, self._left, self._top)) / self.scale

    def boxes_camera_to_site(self, boxes: Floats) -> Floats:
        """Map boxes ``(N, 4)`` from the camera's image to the site's."""
        return boxes * self.scale + (self._left, self._top, self._left, self._top)
