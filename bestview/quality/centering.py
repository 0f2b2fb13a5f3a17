"""Centering term of view quality."""

from __future__ import annotations

import numpy as np

from bestview.quality.boxes import Floats


def centering_score(boxes: Floats, pictures: Floats) -> Floats:
    """Return the centering score: 1 in the middle of the picture, 0 in its corners.

    ``1 - distance of the middles / half the diagonal``

    Args:
        boxes: (..., 4) pixels, without hidden ones.
        pictures: (..., 4) each camera's own picture, pixels; broadcast to `boxes`.

    Returns:
        (...) values in [0, 1].
    """
    offset = (boxes[..., :2] + boxes[..., 2:] - pictures[..., :2] - pictures[..., 2:]) / 2.0
    diagonal = pictures[..., 2:] - pictures[..., :2]
    half = np.hypot(diagonal[..., 0], diagonal[..., 1]) / 2.0
    return np.asarray(np.clip(1.0 - np.hypot(offset[..., 0], offset[..., 1]) / half, 0.0, 1.0))
