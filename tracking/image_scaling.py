"""Images at another size, without the patterns that leaving pixels out makes of fine detail."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt


def scale_image(image: npt.NDArray[np.uint8], size: tuple[int, int]) -> npt.NDArray[np.uint8]:
    """Return an image `(H, W, 3)` at a size, width and height: means over areas, linear where it grows.

    A large image is halved first: OpenCV is many times faster at that than at means over other areas.
    """
    width, height = size
    while image.shape[1] >= 2 * width and image.shape[0] >= 2 * height:
        image = _scale(image, (image.shape[1] // 2, image.shape[0] // 2), cv2.INTER_AREA)
    shrinks = image.shape[1] > width or image.shape[0] > height
    return _scale(image, size, cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)


_LANDSCAPE = 5 / 4
"""Width over height from which a picture counts as landscape."""


def working_scale(size: tuple[int, int], work_width: int) -> float:
    """Return the scale, at most 1, at which pictures of a width and height are searched for people.

    Landscape pictures become at most `work_width` wide. Taller ones keep no more pixels than a picture of
    that width and of 5:4: a camera that is turned upright neither costs more nor loses detail.
    """
    width, height = size
    return min(1.0, work_width / max(width, math.sqrt(_LANDSCAPE * width * height)))


def _scale(image: npt.NDArray[np.uint8], size: tuple[int, int], interpolation: int) -> npt.NDArray[np.uint8]:
    if image.shape[1::-1] == size:
        return image
    return np.asarray(cv2.resize(image, size, interpolation=interpolation), dtype=np.uint8)
