"""The motion of a camera's picture: a similarity of a few pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from tracking.boxes import Floats
from tracking.detectors.base import Image


@dataclass(frozen=True, slots=True)
class Motion:
    """Where the background lies in a frame: a shift, a scale and a turn around the picture's center.

    Attributes:
        x: shift, pixels.
        y: shift, pixels.
        grow: the scale less 1.
        turn: the angle, radians (its sine), clockwise in the picture.
    """

    x: float = 0.0
    y: float = 0.0
    grow: float = 0.0
    turn: float = 0.0

    def matrix(self, size: tuple[int, int]) -> Floats:
        """Return the matrix `(2, 3)` from pixels of the background to pixels of a frame of `size` (w, h)."""
        x, y = size[0] / 2.0, size[1] / 2.0
        grow, turn = self.grow, self.turn
        return np.array(
            [
                [1.0 + grow, -turn, self.x - grow * x + turn * y],
                [turn, 1.0 + grow, self.y - turn * x - grow * y],
            ]
        )

    def homography(self, size: tuple[int, int]) -> Floats:
        """Return `matrix` with a third row, `(3, 3)`."""
        return np.vstack([self.matrix(size), [0.0, 0.0, 1.0]])

    def distance(self, other: Motion, size: tuple[int, int]) -> float:
        """Return the root mean square difference over a picture of `size` (w, h), pixels."""
        shift = (self.x - other.x) ** 2 + (self.y - other.y) ** 2
        radius = (size[0] ** 2 + size[1] ** 2) / 12.0
        return float(
            np.sqrt(shift + radius * ((self.grow - other.grow) ** 2 + (self.turn - other.turn) ** 2))
        )

    def align(self, image: Image, outside: Image) -> Image:
        """Return a frame `(H, W, 3)` moved to where the background is; where it shows nothing, `outside`."""
        if self == STILL:
            return image
        size = (image.shape[1], image.shape[0])
        flags, border = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, cv2.BORDER_TRANSPARENT
        aligned = cv2.warpAffine(
            image, self.matrix(size), size, dst=outside.copy(), flags=flags, borderMode=border
        )
        return np.asarray(aligned, dtype=np.uint8)

    def move_boxes(self, boxes: Floats, size: tuple[int, int]) -> Floats:
        """Move boxes `(K, 4)` of the background, in pixels, to where they are in the frame, still upright."""
        matrix = self.matrix(size)
        return _moved(boxes, lambda centers: centers @ matrix[:, :2].T + matrix[:, 2], 1.0 + self.grow)

    def move_boxes_back(self, boxes: Floats, size: tuple[int, int]) -> Floats:
        """Move boxes `(K, 4)` of the frame, in pixels, to where they are in the background, still upright."""
        matrix = self.matrix(size)
        inverse = np.linalg.inv(matrix[:, :2])
        return _moved(boxes, lambda centers: (centers - matrix[:, 2]) @ inverse.T, 1.0 / (1.0 + self.grow))


def _moved(boxes: Floats, move: Callable[[Floats], Floats], scale: float) -> Floats:
    """Return boxes with their centers moved and their sides scaled."""
    centers = move((boxes[:, :2] + boxes[:, 2:]) / 2.0)
    half = (boxes[:, 2:] - boxes[:, :2]) / 2.0 * scale
    return np.concatenate([centers - half, centers + half], axis=1)


STILL = Motion()
