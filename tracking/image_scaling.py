"""Images at another size, without the patterns that leaving pixels out makes of fine detail."""

from __future__ import annotations

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


def _scale(image: npt.NDArray[np.uint8], size: tuple[int, int], interpolation: int) -> npt.NDArray[np.uint8]:
    if image.shape[1::-1] == size:
        return image
    return np.asarray(cv2.resize(image, size, interpolation=interpolation), dtype=np.uint8)
