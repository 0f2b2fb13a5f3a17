"""Exposure compensation: automatic exposure and white balance change the empty scene by 15 % and more."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from tracking.detectors.base import Image

# Every eighth row and column is enough for a median.
_STEP = 8
# The ratios of dark pixels are noisy, and bright pixels may be clipped.
_MIN_LEVEL = 24
_MAX_LEVEL = 240
_MIN_PIXELS = 30


def gains_over_reference(image: Image, reference: Image) -> npt.NDArray[np.float64]:
    """Return the gain of the image over the reference per channel, `(3,)`.

    The median over the image of the ratio, which is robust to people who cover less than half of it.
    """
    gains = np.ones(3)
    for channel in range(3):
        new = image[::_STEP, ::_STEP, channel].ravel()
        old = reference[::_STEP, ::_STEP, channel].ravel()
        usable = (old >= _MIN_LEVEL) & (old <= _MAX_LEVEL) & (new >= _MIN_LEVEL // 2) & (new <= _MAX_LEVEL)
        if np.count_nonzero(usable) >= _MIN_PIXELS:
            gains[channel] = np.median(new[usable].astype(np.float64) / old[usable])
    return gains


def apply_gains(image: Image, factors: npt.NDArray[np.float64]) -> Image:
    """Multiply each channel by its factor, rounded and clipped to 0..255."""
    return np.asarray(cv2.multiply(image, np.array([*factors, 1.0])), dtype=np.uint8)
