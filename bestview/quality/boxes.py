"""Areas of boxes, (..., 4) left, top, right, bottom in pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def areas_inside_picture(boxes: Floats, pictures: Floats) -> Floats:
    """Return the area of the part of each box inside its picture: two (..., 4), broadcast to (...)."""
    width = np.minimum(boxes[..., 2], pictures[..., 2]) - np.maximum(boxes[..., 0], pictures[..., 0])
    height = np.minimum(boxes[..., 3], pictures[..., 3]) - np.maximum(boxes[..., 1], pictures[..., 1])
    return np.asarray(np.maximum(width, 0.0) * np.maximum(height, 0.0))


def areas(boxes: Floats) -> Floats:
    """Return the area of each box, (..., 4) -> (...); 0 where its sides are the wrong way round."""
    width, height = boxes[..., 2] - boxes[..., 0], boxes[..., 3] - boxes[..., 1]
    return np.asarray(np.maximum(width, 0.0) * np.maximum(height, 0.0))


def area_shares(parts: Floats, wholes: Floats) -> Floats:
    """Divide areas; 0 where the whole has no area."""
    return np.asarray(np.divide(parts, wholes, out=np.zeros(parts.shape), where=wholes > 0))
