"""Color histograms of a person by image region: up to nine (section 3.2; Krumm et al. 2000)."""

from __future__ import annotations

import cv2
import numpy as np

from tracking.boxes import Floats
from tracking.detectors.base import Image, Mask

SPLIT = 8
"""Bins on each axis."""
BINS = SPLIT**2
_LOWEST, _STEP = 64, 16
"""Start of the first bin and width of each bin, in levels of U and V. Clothing lies in 64 to 192; values
beyond count into the first or last bin."""


def uv_histogram(image: Image, mask: Mask) -> Floats:
    """Return the UV histogram of the masked pixels of a BGR image, `(64,)`; zeros without pixels."""
    pixels = cv2.cvtColor(image, cv2.COLOR_BGR2YUV)[mask > 0][:, 1:].astype(np.int64)
    bins = np.clip((pixels - _LOWEST) // _STEP, 0, SPLIT - 1)
    counts = np.bincount(bins[:, 0] * SPLIT + bins[:, 1], minlength=BINS)
    return np.asarray(counts / max(len(pixels), 1))


def mismatch(found: Floats, model: Floats) -> Floats:
    """Return one minus the histogram intersection: eq. (2), 0 for the same colors to 1.

    Args:
        found: `(..., 64)`, histogram of a blob.
        model: `(..., 64)`, histogram of a person; both sum to 1.
    """
    return np.asarray(1.0 - np.minimum(found, model).sum(axis=-1))


class RegionalAppearance:
    """One person's color histograms by image region."""

    def __init__(self, parts: int, size: tuple[int, int]) -> None:
        """Start empty; `size` is the image size (width, height), `parts` the regions on each side."""
        self._parts, self._size = parts, np.array(size, dtype=np.float64)
        self._histograms: dict[tuple[int, int], tuple[Floats, Floats]] = {}

    def __len__(self) -> int:
        return len(self._histograms)

    def store(self, center: Floats, colors: Floats) -> None:
        """Store the histogram seen at a position `(2,)`, replacing that region's previous one."""
        across, down = np.clip((center / self._size * self._parts).astype(int), 0, self._parts - 1).tolist()
        self._histograms[across, down] = center.copy(), colors

    def costs(self, centers: Floats, colors: Floats, cost_if_empty: float) -> Floats:
        """Return the color mismatch of blobs with centers `(B, 2)` and colors `(B, 64)`: `(B,)`.

        Each is compared with the histogram learned nearest to it.
        """
        if not self._histograms:
            return np.full(len(centers), cost_if_empty)
        positions = np.stack([position for position, _ in self._histograms.values()])
        models = np.stack([model for _, model in self._histograms.values()])
        nearest = np.square(centers[:, None] - positions).sum(axis=-1).argmin(axis=1)
        return mismatch(colors, models[nearest])
