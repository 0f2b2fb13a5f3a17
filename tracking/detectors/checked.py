"""Frames that a detector can work on."""

from __future__ import annotations

import numpy as np

from tracking.detectors.base import Image

_CHANNELS = 3


def checked_image(image: Image) -> Image:
    """Give the picture back.

    Raises:
        ValueError: it is not `(H, W, 3)` uint8.
    """
    if image.ndim != _CHANNELS or image.shape[2] != _CHANNELS or image.dtype != np.uint8:
        raise ValueError(f"a frame is (H, W, 3) uint8, not {image.shape} {image.dtype}")
    return image
