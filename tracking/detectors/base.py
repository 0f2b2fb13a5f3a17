"""The `Detector` protocol, and the array types of images and masks."""

from __future__ import annotations

from typing import Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from tracking.types import Detections

Image: TypeAlias = npt.NDArray[np.uint8]
"""A picture, `(H, W, 3)`, blue green red."""
Mask: TypeAlias = npt.NDArray[np.uint8]
"""A mask, `(H, W)`, 0 or 255: what OpenCV calls a binary image."""
Plane: TypeAlias = npt.NDArray[np.float32]
"""One value per pixel or cell, `(H, W)`."""


class Detector(Protocol):
    """Detects candidate boxes in the frames of one camera.

    A detector may remember what it saw (a background, the height of people), so one instance
    belongs to one camera. It has no clock and no randomness: the same frames in the same order give the
    same detections to the byte.
    """

    def detect(self, image: Image, frame: int | None = None) -> Detections:
        """Return the detections of the next frame.

        Args:
            image: `(H, W, 3)` uint8, blue green red, the same size in every call.
            frame: the frame number; `None` means the frame after the last one.

        Raises:
            ValueError: the image has another size or type than before.
        """
        ...
