"""Colours without brightness: histograms over U and V, and their intersection (section 3.2)."""

from __future__ import annotations

import cv2
import numpy as np

from tracking.boxes import Floats
from tracking.detectors.base import Image, Mask

SPLIT = 8
"""Bins on each axis."""
BINS = SPLIT**2
_LOWEST, _STEP = 64, 16
"""Levels of U and V: where the first bin begins, and how wide each is. What clothes have lies in 64 to 192;
beyond is the first or the last bin."""


def uv_histogram(image: Image, mask: Mask) -> Floats:
    """Give the shares of the colours of the masked pixels of a BGR picture, `(64,)`; zeros where none is."""
    chosen = cv2.cvtColor(image, cv2.COLOR_BGR2YUV)[mask > 0][:, 1:].astype(np.int64)
    bins = np.clip((chosen - _LOWEST) // _STEP, 0, SPLIT - 1)
    counts = np.bincount(bins[:, 0] * SPLIT + bins[:, 1], minlength=BINS)
    return np.asarray(counts / max(len(chosen), 1))


def mismatch(found: Floats, model: Floats) -> Floats:
    """Give how little of the models' colours is found: eq. (2), 0 for all of them to 1 for none.

    Args:
        found: `(..., 64)` shares of the pixels in a blob.
        model: `(..., 64)` shares of a person's; both sum to 1, which is what dividing by their sizes does.
    """
    return np.asarray(1.0 - np.minimum(found, model).sum(axis=-1))
