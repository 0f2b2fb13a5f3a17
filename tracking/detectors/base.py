"""The `Detector` protocol, the array types of images and masks, and checks that detectors share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from tracking.types import Detections

Image: TypeAlias = npt.NDArray[np.uint8]
"""An image, `(H, W, 3)`, BGR."""
Mask: TypeAlias = npt.NDArray[np.uint8]
"""A mask, `(H, W)`, 0 or 255: what OpenCV calls a binary image."""
Plane: TypeAlias = npt.NDArray[np.float32]
"""One value per pixel or cell, `(H, W)`."""
Relight: TypeAlias = Callable[[Image], Image]
"""Changes the light of an image of any size."""
_CHANNELS = 3


class Detector(Protocol):
    """Detects candidate boxes in the frames of one camera.

    A detector may keep state (a background, the height of people), so one instance belongs to one
    camera. It uses no clock and no random numbers: the same frames in the same order give the same
    detections, byte for byte.
    """

    def detect(self, image: Image, frame: int | None = None) -> Detections:
        """Return the detections of the next frame.

        Args:
            image: `(H, W, 3)` uint8, BGR, the same size in every call.
            frame: the frame number; `None` means the frame after the last one.

        Raises:
            ValueError: the image has another size or type than before.
        """
        ...


def validate_image(image: Image) -> Image:
    """Check an image and return it.

    Raises:
        ValueError: it is not `(H, W, 3)` uint8.
    """
    if image.ndim != _CHANNELS or image.shape[2] != _CHANNELS or image.dtype != np.uint8:
        raise ValueError(f"a frame is (H, W, 3) uint8, not {image.shape} {image.dtype}")
    return image


def require_at_least_one(settings: object, *names: str) -> None:
    """Check counts among a detector's settings.

    Raises:
        ValueError: one of them is below 1; the message names it.
    """
    for name in names:
        value = getattr(settings, name)
        if value < 1:
            raise ValueError(f"{name} must be at least 1, not {value}")


def require_positive(settings: object, *names: str) -> None:
    """Check times and lengths among a detector's settings.

    Raises:
        ValueError: one of them is not above 0; the message names it.
    """
    for name in names:
        value = getattr(settings, name)
        if not value > 0.0:
            raise ValueError(f"{name} must be above 0, not {value:g}")
