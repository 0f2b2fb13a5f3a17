"""How much of a person the picture holds."""

from __future__ import annotations

import numpy as np

from bestview.quality.boxes import Floats, area_shares, areas, areas_inside_picture

_EDGE_MARGIN = 0.03
"""Share of the box's height from an edge at which it counts as clear of it."""
_EDGE_PENALTY = 0.05
"""What a box loses that ends at the upper or lower edge: nobody can say how much is beyond it."""
_MINIMUM_MARGIN = 1e-6
"""Pixels; a box without any height has this much room, so that none is divided by nothing."""
_UPRIGHT_ASPECT_RATIO = 0.37
"""Width over height of a box at an upright person: one at a side edge that is slimmer is a part of them."""


def visible_share(boxes: Floats, pictures: Floats) -> Floats:
    """Share of the person inside the picture, as far as their box tells.

    ``area(box in picture) / area(box)``, times ``1 - 0.05 n`` for the nearer of the upper and lower edge,
    times ``1 - n (1 - min(width / (0.37 height), 1))`` for the nearer side edge, with `n` how near it is:
    ``1 - min(gap / (0.03 height), 1)``. Detectors keep their boxes inside the picture. One that ends at the
    upper or lower edge tells that something is missing, though not how much; one that ends at a side edge
    and is slimmer than people are tells that, too. Of who sticks out at a side the area says it.

    Args:
        boxes: (..., 4) pixels, nobody hidden.
        pictures: (..., 4) where each camera's own picture lies, pixels; broadcast to `boxes`.

    Returns:
        (...) values in [0, 1].
    """
    inside = area_shares(areas_inside_picture(boxes, pictures), areas(boxes))
    left, top, right, bottom = np.moveaxis((boxes - pictures) * np.array([1.0, 1.0, -1.0, -1.0]), -1, 0)
    tall = boxes[..., 3] - boxes[..., 1]
    ends = _edge_proximity(np.minimum(top, bottom), tall)
    beside = np.minimum(left, right)
    beside = np.where(beside < 0.0, 0.0, _edge_proximity(beside, tall))
    slim = np.minimum(area_shares(boxes[..., 2] - boxes[..., 0], _UPRIGHT_ASPECT_RATIO * tall), 1.0)
    return np.asarray(inside * (1.0 - _EDGE_PENALTY * ends) * (1.0 - beside * (1.0 - slim)))


def _edge_proximity(gap: Floats, tall: Floats) -> Floats:
    """Say how near (...) boxes are to an edge that is `gap` away: 1 at it or beyond, 0 clear of it."""
    room = np.maximum(_EDGE_MARGIN * tall, _MINIMUM_MARGIN)
    return np.asarray(1.0 - np.clip(gap / room, 0.0, 1.0))
