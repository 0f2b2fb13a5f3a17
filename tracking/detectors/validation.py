"""Checks of images and settings shared by the detectors."""

from __future__ import annotations

import numpy as np

from tracking.detectors.base import Image

_CHANNELS = 3


def validate_image(image: Image) -> Image:
    """Return the image, after checking it.

    Raises:
        ValueError: it is not `(H, W, 3)` uint8.
    """
    if image.ndim != _CHANNELS or image.shape[2] != _CHANNELS or image.dtype != np.uint8:
        raise ValueError(f"a frame is (H, W, 3) uint8, not {image.shape} {image.dtype}")
    return image


def require_at_least_one(settings: object, *names: str) -> None:
    """Check counts among a detector's settings.

    Raises:
        ValueError: one of them is below 1; the text names it.
    """
    for name in names:
        value = getattr(settings, name)
        if value < 1:
            raise ValueError(f"{name} must be at least 1, not {value}")
