"""Blob segmentation: connected foreground of one person, several, or none (section 3).

The background is a Gaussian of each pixel in YUV (Wren et al., PAMI 1997).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from tracking.baselines.temporal_consistency.color_gain import apply_gains, gains_over_reference
from tracking.baselines.temporal_consistency.regional_appearance import uv_histogram
from tracking.baselines.temporal_consistency.settings import BlobSettings
from tracking.boxes import Floats
from tracking.detectors.base import Image, Mask, Plane

_INLIERS = 3.0
"""Robust standard deviations from the median within which a sample counts as background."""
_SAMPLE_S = 0.5
"""Seconds between two images that are learned."""
_MAD = 1.4826
"""Standard deviation over median absolute deviation of a normal distribution."""


class YuvBackground:
    """Mean and covariance of each pixel, `(H, W, 3)` and `(H, W, 3, 3)`."""

    def __init__(self, images: Sequence[Image], settings: BlobSettings, sample_s: float = _SAMPLE_S) -> None:
        """Learn from images of the room, empty or with people who keep moving.

        Images that are learned later are `sample_s` seconds apart.

        The report's room is empty. Here only samples near the median count, so that people who walk through
        are left out.

        Raises:
            ValueError: there is no image.
        """
        if not images:
            raise ValueError("a background needs at least one image")
        self._reference = images[0]
        levels = np.stack([_yuv(self._normalized(image)) for image in images])
        median = np.median(levels, axis=0)
        floors = np.array([settings.brightness_floor, settings.chroma_floor, settings.chroma_floor])
        spread = np.maximum(_MAD * np.median(np.abs(levels - median), axis=0), floors)
        inliers = (np.abs(levels - median) <= _INLIERS * spread).all(axis=-1)
        count = np.maximum(inliers.sum(axis=0), 1)[..., None]
        mean = np.where(
            inliers.any(axis=0)[..., None], (levels * inliers[..., None]).sum(axis=0) / count, median
        )
        deviations = np.where(inliers[..., None], levels - mean, 0.0)
        covariance = np.einsum("n...i,n...j->...ij", deviations, deviations) / count[..., None]
        self._mean: Plane = mean.astype(np.float32)
        self._whitening = _whitening(covariance + np.diag(floors**2))
        self._rate = min(sample_s / settings.learn_s, 1.0)
        self._squared = np.float32(settings.threshold**2)

    def foreground(self, image: Image) -> Mask:
        """Return the foreground mask `(H, W)`: pixels farther from the background than the threshold."""
        distance = self.squared_distance(image)
        return np.where(distance > self._squared, np.uint8(255), np.uint8(0))

    def squared_distance(self, image: Image) -> Plane:
        """Return the squared Mahalanobis distance of every pixel from the background, `(H, W)`."""
        y, u, v = cv2.split(_yuv(self._normalized(image)) - self._mean)
        # With the Cholesky factor L of the inverse covariance, |L' d|^2 is d' C^-1 d.
        a, b, c, d, e, f = self._whitening
        return np.asarray(np.square(a * y + b * u + c * v) + np.square(d * u + e * v) + np.square(f * v))

    def learn(self, image: Image, unoccupied: Mask) -> None:
        """Update the mean with an image where `unoccupied` is 255."""
        cv2.accumulateWeighted(_yuv(self._normalized(image)), self._mean, self._rate, mask=unoccupied)

    def _normalized(self, image: Image) -> Image:
        """Return the image at the exposure of the reference image."""
        return apply_gains(image, 1.0 / gains_over_reference(image, self._reference))


def _yuv(image: Image) -> Plane:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2YUV), dtype=np.float32)


def _whitening(covariance: Floats) -> tuple[Plane, ...]:
    """Return the six entries of the transposed Cholesky factors of the inverses `(H, W, 3, 3)`."""
    factors = np.linalg.cholesky(np.linalg.inv(covariance)).astype(np.float32)
    upper = ((0, 0), (1, 0), (2, 0), (1, 1), (2, 1), (2, 2))
    return tuple(np.ascontiguousarray(factors[..., row, column]) for row, column in upper)


_MEDIAN = 3
"""Side of the median filter that removes isolated pixels."""
_MAX_DILATION = 0.1
"""Maximum dilation of the foreground, as a share of the image's width."""


@dataclass(frozen=True, slots=True, eq=False)
class Blob:
    """One connected foreground region, in pixels of the working image.

    Attributes:
        box: `(4,)`, left, top, right, bottom.
        mask: `(h, w)`, the pixels of the box that belong to it, 255.
        area: number of these pixels.
        colors: `(64,)`, UV histogram of its foreground.
    """

    box: Floats
    mask: Mask
    area: int
    colors: Floats

    @property
    def center(self) -> Floats:
        """Where it is, `(2,)`: the median of its box."""
        return (self.box[:2] + self.box[2:]) / 2.0


class BlobDetector:
    """Segments one camera's images into blobs; people who stand close together share one.

    Attributes:
        size: width and height of the working image.
        pixels_per_meter: pixels of the working image per meter of floor.
    """

    def __init__(
        self, size: tuple[int, int], room_m: float, settings: BlobSettings, sample_s: float = _SAMPLE_S
    ) -> None:
        """Set up for images of `size` (width, height) in pixels that show `room_m` meters of floor across.

        Between two images that are learned are `sample_s` seconds.
        """
        self._settings, self._sample_s = settings, sample_s
        width, height = size
        scale = min(1.0, settings.work_width / width)
        self.size = max(round(width * scale), 1), max(round(height * scale), 1)
        self.pixels_per_meter = self.size[0] / room_m
        self._min_area = settings.min_area_m2 * self.pixels_per_meter**2
        # Limited by the image's width: a larger dilation would join separate people.
        grow = 2 * round(min(settings.dilation_m * self.pixels_per_meter, self.size[0] * _MAX_DILATION)) + 1
        self._kernel = np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (grow, grow)), dtype=np.uint8)
        self._background: YuvBackground | None = None

    @property
    def ready(self) -> bool:
        """Whether the background is known."""
        return self._background is not None

    def resize(self, image: Image) -> Image:
        """Return the image at the working size."""
        if (image.shape[1], image.shape[0]) == self.size:
            return image
        return np.asarray(cv2.resize(image, self.size, interpolation=cv2.INTER_AREA), dtype=np.uint8)

    def prepare(self, work_images: Sequence[Image]) -> None:
        """Learn the background from working images.

        Raises:
            ValueError: there is no image.
        """
        self._background = YuvBackground(work_images, self._settings, self._sample_s)

    def detect(self, work_image: Image, *, learn: bool) -> tuple[Blob, ...]:
        """Return the blobs of a working image, from left to right; none while the background is unknown.

        `learn`: update the background outside the blobs.
        """
        if self._background is None:
            return ()
        filtered = np.asarray(
            cv2.medianBlur(self._background.foreground(work_image), _MEDIAN), dtype=np.uint8
        )
        grown = np.asarray(cv2.dilate(filtered, self._kernel), dtype=np.uint8)
        if learn:
            self._background.learn(work_image, np.asarray(cv2.bitwise_not(grown), dtype=np.uint8))
        count, labels, stats, _ = cv2.connectedComponentsWithStats(grown, connectivity=8)
        blobs = []
        for label in range(1, count):
            left, top, width, height, area = stats[label].tolist()
            if area < self._min_area:
                continue
            part = slice(top, top + height), slice(left, left + width)
            mask = np.where(labels[part] == label, np.uint8(255), np.uint8(0))
            box = np.array([left, top, left + width, top + height], dtype=np.float64)
            blobs.append(Blob(box, mask, area, uv_histogram(work_image[part], mask & filtered[part])))
        return tuple(sorted(blobs, key=lambda blob: tuple(blob.box.tolist())))
