"""How much of a person the picture holds."""

from __future__ import annotations

import numpy as np

from bestview.quality.boxes import Floats, areas, areas_inside, shares

_CUT = 0.5
"""What a box is worth that ends at the upper or lower edge: nobody can say how much is beyond it."""

_NEAR_EDGE = 0.03
"""Share of the box's height from the edge at which it counts as clear of it."""


def whole(boxes: Floats, pictures: Floats) -> Floats:
    """Share of the box inside the picture, and less where the upper or lower edge cuts it.

    ``area(box in picture) / area(box) * (1/2 + 1/2 min(gap / (0.03 height), 1))`` with `gap` the distance to
    the nearer of the two edges, at least 0. Detectors that keep their boxes inside the picture do not
    say how much of head or feet is missing; a box that ends at the edge tells that something is.

    Args:
        boxes: (..., 4) pixels, nobody hidden.
        pictures: (..., 4) where each camera's own picture lies, pixels; broadcast to `boxes`.

    Returns:
        (...) values in [0, 1].
    """
    inside = shares(areas_inside(boxes, pictures), areas(boxes))
    gap = np.minimum(boxes[..., 1] - pictures[..., 1], pictures[..., 3] - boxes[..., 3])
    room = np.maximum(_NEAR_EDGE * (boxes[..., 3] - boxes[..., 1]), np.finfo(np.float64).tiny)
    return np.asarray(inside * (_CUT + (1.0 - _CUT) * np.clip(gap / room, 0.0, 1.0)))
