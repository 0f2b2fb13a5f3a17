"""How somebody looks in each part of the room: up to nine histograms (section 3.2; Krumm et al. 2000)."""

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
    """Give the shares of the colors of the masked pixels of a BGR picture, `(64,)`; zeros where none is."""
    chosen = cv2.cvtColor(image, cv2.COLOR_BGR2YUV)[mask > 0][:, 1:].astype(np.int64)
    bins = np.clip((chosen - _LOWEST) // _STEP, 0, SPLIT - 1)
    counts = np.bincount(bins[:, 0] * SPLIT + bins[:, 1], minlength=BINS)
    return np.asarray(counts / max(len(chosen), 1))


def mismatch(found: Floats, model: Floats) -> Floats:
    """Give how little of the models' colors is found: eq. (2), 0 for all of them to 1 for none.

    Args:
        found: `(..., 64)` shares of the pixels in a blob.
        model: `(..., 64)` shares of a person's; both sum to 1, which is what dividing by their sizes does.
    """
    return np.asarray(1.0 - np.minimum(found, model).sum(axis=-1))


class RegionalAppearance:
    """One person's histograms, each with the place where it was taken."""

    def __init__(self, parts: int, size: tuple[int, int]) -> None:
        """Begin with none; `size` is that of the picture (width, height), `parts` are on each side of it."""
        self._parts, self._size = parts, np.array(size, dtype=np.float64)
        self._looks: dict[tuple[int, int], tuple[Floats, Floats]] = {}

    def __len__(self) -> int:
        return len(self._looks)

    def learn(self, middle: Floats, colors: Floats) -> None:
        """Take in how the person looks at a place `(2,)`; what was known of that part of the room goes."""
        across, down = np.clip((middle / self._size * self._parts).astype(int), 0, self._parts - 1).tolist()
        self._looks[across, down] = middle.copy(), colors

    def costs(self, middles: Floats, colors: Floats, unknown: float) -> Floats:
        """Say how unlike the person blobs are: middles `(B, 2)`, colors `(B, 64)` give `(B,)`.

        Each is compared with the histogram that was taken nearest to it.
        """
        if not self._looks:
            return np.full(len(middles), unknown)
        taken = np.stack([place for place, _ in self._looks.values()])
        models = np.stack([model for _, model in self._looks.values()])
        nearest = np.square(middles[:, None] - taken).sum(axis=-1).argmin(axis=1)
        return mismatch(colors, models[nearest])
