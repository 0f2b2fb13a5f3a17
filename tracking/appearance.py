"""Gray histograms of boxes and the appearance distances between histograms."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats

GRAY_LEVELS = 256

AppearanceMeasure = Literal["bhattacharyya", "intersection"]


def gray_histograms(
    gray: NDArray[np.uint8],
    boxes: Floats,
    bins: int = 64,
    mask: NDArray[np.uint8] | None = None,
) -> Floats:
    """Return the gray histogram of each box, shape (K, bins), rows summing to 1 (paper II.D, Example 1).

    `gray` is (H, W); `boxes` (K, 4) in pixels are clipped to the image; pixels where `mask` (H, W) is 0 are
    left out. A box without pixels gets the uniform histogram.

    Raises:
        ValueError: `bins` is not between 1 and 256.
    """
    if not 1 <= bins <= GRAY_LEVELS:
        raise ValueError(f"bins must be between 1 and {GRAY_LEVELS}, not {bins}")
    levels = np.arange(GRAY_LEVELS) * bins // GRAY_LEVELS
    result = np.full((len(boxes), bins), 1.0 / bins)
    for row, (left, top, right, bottom) in enumerate(_pixel_ranges(boxes, gray.shape)):
        pixels = gray[top:bottom, left:right]
        kept = pixels.ravel() if mask is None else pixels[mask[top:bottom, left:right] != 0]
        if kept.size:
            result[row] = np.bincount(levels[kept], minlength=bins) / kept.size
    return result


def _pixel_ranges(boxes: Floats, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Round boxes (K, 4) to pixel ranges inside an image of `shape` (height, width)."""
    height, width = shape[:2]
    limits = np.array([width, height, width, height], dtype=np.float64)
    return np.clip(np.rint(boxes), 0.0, limits).astype(np.int64)


def appearance_distance_matrix(
    first: Floats, second: Floats, measure: AppearanceMeasure = "bhattacharyya"
) -> Floats:
    """Return the distances of all pairs of rows: g(.) of paper II.B, 0 for identical to 1 for disjoint.

    `first` is (..., I, B) and `second` (..., J, B); the result is (..., I, J). Empty
    histograms (B = 0 on either side) have distance 0.
    """
    if first.shape[-1] == 0 or second.shape[-1] == 0:
        lead = np.broadcast_shapes(first.shape[:-2], second.shape[:-2])
        return np.zeros((*lead, first.shape[-2], second.shape[-2]))
    if measure == "intersection":
        shared = np.minimum(first[..., :, None, :], second[..., None, :, :]).sum(axis=-1)
        return np.asarray(np.clip(1.0 - shared, 0.0, 1.0))
    coefficients = np.sqrt(first) @ np.sqrt(np.swapaxes(second, -1, -2))
    return np.asarray(np.sqrt(np.clip(1.0 - coefficients, 0.0, 1.0)))
