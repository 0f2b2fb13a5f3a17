"""Gaussian background model of each pixel in YUV (section 3; Wren et al., PAMI 1997)."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from tracking.baselines.temporal_consistency.settings import BlobSettings
from tracking.boxes import Floats
from tracking.detectors.background.color_gain import apply_gains, channel_gains
from tracking.detectors.base import Image, Mask, Plane

_INLIERS = 3.0
"""Deviations from the median, in robust standard deviations, within which a sample is the background's."""
_MAD = 1.4826
"""From a median absolute deviation to a standard deviation (normal distribution)."""


class YuvBackground:
    """Mean and covariance of each pixel, `(H, W, 3)` and `(H, W, 3, 3)`."""

    def __init__(self, images: Sequence[Image], settings: BlobSettings) -> None:
        """Learn from images of the room, empty or with people who keep moving.

        The report's room is empty. Here the mean is of what lies near the median, so that who walks
        through some of the pictures is no part of it.

        Raises:
            ValueError: there is no picture.
        """
        if not images:
            raise ValueError("a background needs at least one image")
        self._reference = images[0]
        levels = np.stack([_yuv(self._leveled(image)) for image in images])
        middle = np.median(levels, axis=0)
        floors = np.array([settings.brightness_floor, settings.chroma_floor, settings.chroma_floor])
        spread = np.maximum(_MAD * np.median(np.abs(levels - middle), axis=0), floors)
        usual = (np.abs(levels - middle) <= _INLIERS * spread).all(axis=-1)
        count = np.maximum(usual.sum(axis=0), 1)[..., None]
        mean = np.where(usual.any(axis=0)[..., None], (levels * usual[..., None]).sum(axis=0) / count, middle)
        off = np.where(usual[..., None], levels - mean, 0.0)
        covariance = np.einsum("n...i,n...j->...ij", off, off) / count[..., None]
        self._mean: Plane = mean.astype(np.float32)
        self._whitening = _whitening(covariance + np.diag(floors**2))
        self._rate = settings.learn_rate
        self._squared = np.float32(settings.threshold**2)

    def foreground(self, image: Image) -> Mask:
        """Return the foreground mask `(H, W)`: pixels farther from the background than the threshold."""
        distance = self.distance(image)
        return np.where(distance > self._squared, np.uint8(255), np.uint8(0))

    def distance(self, image: Image) -> Plane:
        """Return the squared Mahalanobis distance of every pixel from the background, `(H, W)`."""
        y, u, v = cv2.split(_yuv(self._leveled(image)) - self._mean)
        # With the Cholesky factor L of the inverse covariance, |L' d|^2 is d' C^-1 d.
        a, b, c, d, e, f = self._whitening
        return np.asarray(np.square(a * y + b * u + c * v) + np.square(d * u + e * v) + np.square(f * v))

    def learn(self, image: Image, free: Mask) -> None:
        """Update the mean with an image where `free` is 255."""
        cv2.accumulateWeighted(_yuv(self._leveled(image)), self._mean, self._rate, mask=free)

    def _leveled(self, image: Image) -> Image:
        """Return the image at the exposure of the reference image."""
        return apply_gains(image, 1.0 / channel_gains(image, self._reference))


def _yuv(image: Image) -> Plane:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2YUV), dtype=np.float32)


def _whitening(covariance: Floats) -> tuple[Plane, ...]:
    """Return the six entries of the transposed Cholesky factors of the inverses `(H, W, 3, 3)`."""
    factors = np.linalg.cholesky(np.linalg.inv(covariance)).astype(np.float32)
    upper = ((0, 0), (1, 0), (2, 0), (1, 1), (2, 1), (2, 2))
    return tuple(np.ascontiguousarray(factors[..., row, column]) for row, column in upper)
