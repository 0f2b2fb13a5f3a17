"""Disturbances of the lens: out of focus, drops, cover, spray."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from benchmarks.robustness.disturbances.base import Disturbance, Floats, Moment, blend, blurred, smooth_field
from server.camera.sources import Image


@dataclass(frozen=True)
class OutOfFocus(Disturbance):
    """A blurred picture."""

    sigma: float

    def apply(self, image: Image, moment: Moment) -> Image:
        """Blur."""
        del moment
        return blurred(image, self.sigma)


@dataclass(frozen=True)
class LensDrops(Disturbance):
    """Drops on the lens: discs with a blurred and displaced picture, brighter at their rims."""

    drops: int
    radius: float = 0.05

    def apply(self, image: Image, moment: Moment) -> Image:
        """Draw the drops, which stay where they are."""
        height, width = image.shape[:2]
        random = moment.random("drops", lasting=True)
        inside = np.zeros((height, width), dtype=np.uint8)
        for x, y, size in random.uniform((0.0, 0.0, 0.5), (1.0, 1.0, 1.5), (self.drops, 3)).tolist():
            radius = max(round(self.radius * size * width), 2)
            cv2.circle(inside, (round(x * width), round(y * height)), radius, 255, -1)
        share = cv2.GaussianBlur(inside, (0, 0), 0.006 * width).astype(np.float32) / np.float32(255.0)
        seen = blurred(np.asarray(image[::-1, ::-1], dtype=np.uint8), 0.03) * np.float32(0.8) + 40.0
        return blend(image, np.asarray(seen, dtype=np.float32), share)


@dataclass(frozen=True)
class Covered(Disturbance):
    """Something in front of the lens: dark, with the sensor's noise, but for a part at the side."""

    share: float
    """Of the picture's width."""
    level: float = 18.0

    def apply(self, image: Image, moment: Moment) -> Image:
        """Draw the cover."""
        height, width = image.shape[:2]
        noise = 3.0 * moment.random("cover").standard_normal((height, width, 1), dtype=np.float32)
        return blend(image, self.level + noise, self.cover(moment, (width, height)))

    def cover(self, moment: Moment, size: tuple[int, int]) -> Floats:
        """Return the left part, with a soft edge."""
        del moment
        columns = np.arange(size[0], dtype=np.float32) / size[0]
        covered = np.clip((self.share - columns) / 0.06 + 0.5, 0.0, 1.0)
        return np.broadcast_to(covered, size[::-1]).astype(np.float32)


@dataclass(frozen=True)
class Sprayed(Disturbance):
    """Paint on the lens, with holes."""

    share: float
    """Of the picture, roughly."""
    color: tuple[float, float, float] = (40.0, 60.0, 150.0)

    def apply(self, image: Image, moment: Moment) -> Image:
        """Blend with the paint."""
        paint = self.cover(moment, (image.shape[1], image.shape[0]))
        return blend(image, np.array(self.color, dtype=np.float32), paint)

    def cover(self, moment: Moment, size: tuple[int, int]) -> Floats:
        """Return the paint."""
        field = smooth_field(moment.random("spray", lasting=True), size[::-1], 0.2)
        edge = np.float32(np.quantile(field, self.share))
        return np.asarray(np.clip((edge - field) / 0.08 + 0.5, 0.0, 1.0), dtype=np.float32)
