"""How well a view shows an object: the c(n, b) of section III comes from here."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

HIDDEN_COST = 1.0
"""The view cost of a camera that runs but does not see the object."""


def size_quality(boxes: NDArray[np.float64], width: float, height: float) -> NDArray[np.float64]:
    """Linear size of the part of each box inside the picture: ``sqrt(box area / picture area)``.

    The paper's view quality is the size of the bounding box (section III); the root makes it grow with
    how near the object is instead of with the square of that, so that one very near view does not
    make all the others look equally bad.

    Args:
        boxes: (..., 4) left, top, right, bottom in pixels; NaN where the object is hidden.
        width: of the picture, pixels.
        height: of the picture, pixels.

    Returns:
        (...) values in [0, 1]; 0 where hidden, outside the picture or empty.

    Raises:
        ValueError: a picture without area, or boxes whose last axis is not 4 long.
    """
    if not (width > 0 and height > 0):
        raise ValueError(f"a picture of {width} x {height} pixels has no area")
    if boxes.ndim < 1 or boxes.shape[-1] != 4:  # noqa: PLR2004 — left, top, right, bottom
        raise ValueError(f"boxes have shape {boxes.shape}, not (..., 4)")
    left, top = np.maximum(boxes[..., 0], 0.0), np.maximum(boxes[..., 1], 0.0)
    right, bottom = np.minimum(boxes[..., 2], width), np.minimum(boxes[..., 3], height)
    area = np.maximum(right - left, 0.0) * np.maximum(bottom - top, 0.0)
    return np.asarray(np.sqrt(np.nan_to_num(area) / (width * height)))


def view_cost(quality: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn quality in [0, 1] into the cost ``1 - quality`` of section III; hidden (quality 0) costs 1."""
    return HIDDEN_COST - np.clip(quality, 0.0, 1.0)
