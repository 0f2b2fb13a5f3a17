"""How central a person is in the picture."""

from __future__ import annotations

import numpy as np

from bestview.quality.boxes import Floats


def centering_score(boxes: Floats, pictures: Floats) -> Floats:
    """1 in the middle of the picture, 0 in its corners: ``1 - distance of the middles / half the diagonal``.

    Args:
        boxes: (..., 4) pixels, nobody hidden.
        pictures: (..., 4) where each camera's own picture lies, pixels; broadcast to `boxes`.

    Returns:
        (...) values in [0, 1].
    """
    off = (boxes[..., :2] + boxes[..., 2:] - pictures[..., :2] - pictures[..., 2:]) / 2.0
    diagonal = pictures[..., 2:] - pictures[..., :2]
    half = np.hypot(diagonal[..., 0], diagonal[..., 1]) / 2.0
    return np.asarray(np.clip(1.0 - np.hypot(off[..., 0], off[..., 1]) / half, 0.0, 1.0))
