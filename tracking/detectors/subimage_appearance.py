"""Sub-images as appearance, in the form of histograms (paper IV.A.1).

A pixel of value v in [0, 1] becomes the two numbers v and 1 - v; all of a sub-image's, divided by how many
pixels it has, sum to 1. The intersection distance of two such rows is then the mean absolute difference of
the two sub-images, and the Bhattacharyya distance the Hellinger distance of their pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tracking.boxes import Floats
from tracking.detectors.base import Image


@dataclass(frozen=True, slots=True)
class SubimageSettings:
    """The size and colors of a sub-image.

    Raises:
        ValueError: a side has no pixel.
    """

    columns: int = 12  # pixels across, whatever the box's width
    rows: int = 12  # pixels down
    color: bool = True  # false: gray

    def __post_init__(self) -> None:
        if self.columns < 1 or self.rows < 1:
            raise ValueError(f"a sub-image has at least 1x1 pixels, not {self.columns}x{self.rows}")

    @property
    def length(self) -> int:
        """The length of a row."""
        return 2 * self.columns * self.rows * (_CHANNELS if self.color else 1)


_CHANNELS = 3
_WHITE = 255.0


def subimage_histograms(image: Image, boxes: Floats, settings: SubimageSettings) -> Floats:
    """Return the resized sub-image of each box as a row: `(K, B)`, rows sum to 1.

    Args:
        image: `(H, W, 3)`.
        boxes: `(K, 4)` in pixels, cut at the picture's borders; where nothing is left the row is gray.
        settings: the sub-images' size.
    """
    rows = np.full((len(boxes), settings.length), 1.0 / settings.length)
    limits = np.array([image.shape[1], image.shape[0]] * 2, dtype=np.float64)
    for k, edges in enumerate(np.rint(np.clip(boxes, 0.0, limits)).astype(np.int64)):
        left, top, right, bottom = edges
        if right <= left or bottom <= top:
            continue
        size = (settings.columns, settings.rows)
        small = cv2.resize(image[top:bottom, left:right], size, interpolation=cv2.INTER_AREA)
        if not settings.color:
            small = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY)
        light = small.ravel() / _WHITE
        rows[k] = np.concatenate([light, 1.0 - light]) / light.size
    return rows
