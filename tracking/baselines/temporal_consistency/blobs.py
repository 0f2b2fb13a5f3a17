"""Blob segmentation: connected foreground of one person, several, or none (section 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from tracking.baselines.temporal_consistency.background import YuvBackground
from tracking.baselines.temporal_consistency.regional_appearance import uv_histogram
from tracking.baselines.temporal_consistency.settings import BlobSettings
from tracking.boxes import Floats
from tracking.detectors.base import Image, Mask

_MEDIAN = 3
"""Pixels of the median filter that takes lonely pixels out."""
_MOST_GROWN = 0.1
"""Of the picture's width, by how much the foreground grows at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Blob:
    """One connected foreground region, in pixels of the working image.

    Attributes:
        box: `(4,)`, left, top, right, bottom.
        mask: `(h, w)`, 255 where the box is filled.
        area: pixels that are.
        colors: `(64,)`, shares of the colors of its foreground.
    """

    box: Floats
    mask: Mask
    area: int
    colors: Floats

    @property
    def center(self) -> Floats:
        """Where it is, `(2,)`: the middle of its box."""
        return (self.box[:2] + self.box[2:]) / 2.0


class BlobDetector:
    """Segments one camera's images into blobs; people who stand close together share one.

    Attributes:
        size: of the working picture, width and height.
        pixels_per_meter: pixels of it that are a meter of floor.
    """

    def __init__(self, size: tuple[int, int], room_m: float, settings: BlobSettings) -> None:
        """Set up for images of `size` (width, height) in pixels that show `room_m` meters of floor across."""
        self._settings = settings
        width, height = size
        scale = min(1.0, settings.work_width / width)
        self.size = max(round(width * scale), 1), max(round(height * scale), 1)
        self.pixels_per_meter = self.size[0] / room_m
        self._least = settings.min_area_m2 * self.pixels_per_meter**2
        # However little floor is in the picture: more than a part of it joins nothing that belongs together.
        grow = 2 * round(min(settings.dilation_m * self.pixels_per_meter, self.size[0] * _MOST_GROWN)) + 1
        self._grow = np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (grow, grow)), dtype=np.uint8)
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

    def prepare(self, images: Sequence[Image]) -> None:
        """Learn the background from working pictures.

        Raises:
            ValueError: there is none.
        """
        self._background = YuvBackground(images, self._settings)

    def detect(self, image: Image, *, learn: bool) -> tuple[Blob, ...]:
        """Return the blobs of a working image, from left to right; none while the background is unknown.

        `learn`: what is around them goes into the background.
        """
        if self._background is None:
            return ()
        seen = np.asarray(cv2.medianBlur(self._background.foreground(image), _MEDIAN), dtype=np.uint8)
        grown = np.asarray(cv2.dilate(seen, self._grow), dtype=np.uint8)
        if learn:
            self._background.learn(image, np.asarray(cv2.bitwise_not(grown), dtype=np.uint8))
        count, labels, stats, _ = cv2.connectedComponentsWithStats(grown, connectivity=8)
        found = []
        for label in range(1, count):
            left, top, wide, high, area = stats[label].tolist()
            if area < self._least:
                continue
            part = slice(top, top + high), slice(left, left + wide)
            shape = np.where(labels[part] == label, np.uint8(255), np.uint8(0))
            box = np.array([left, top, left + wide, top + high], dtype=np.float64)
            found.append(Blob(box, shape, area, uv_histogram(image[part], shape & seen[part])))
        return tuple(sorted(found, key=lambda blob: tuple(blob.box.tolist())))
