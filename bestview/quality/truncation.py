"""Truncation term of view quality: the share of a person inside the picture."""

from __future__ import annotations

import numpy as np

from bestview.quality.boxes import Floats, area_shares, areas, areas_inside_picture

_EDGE_MARGIN = 0.03
"""Share of the box's height from an edge at which it counts as clear of it."""
_EDGE_PENALTY = 0.05
"""What a box at the upper or lower edge loses: how much is beyond it is unknown."""
_MINIMUM_MARGIN = 1e-6
"""Pixels; avoids a division by zero for boxes without height."""
_UPRIGHT_ASPECT_RATIO = 0.37
"""Width over height of the box of an upright person: a slimmer one at a side edge is truncated."""


def visible_share(boxes: Floats, pictures: Floats) -> Floats:
    """Return the share of the person inside the picture, as far as the box tells.

    ``area(box in picture) / area(box)``, times ``1 - 0.05 n`` for the nearer of the upper and lower edge,
    times ``1 - n (1 - min(width / (0.37 height), 1))`` for the nearer side edge, with `n` how near it is:
    ``1 - min(gap / (0.03 height), 1)``. Detectors keep their boxes inside the picture. One that ends at the
    upper or lower edge is truncated by an unknown amount; one that ends at a side edge and is slimmer than
    people are is truncated as well. For boxes beyond a side edge the area accounts for it.

    Args:
        boxes: (..., 4) pixels, without hidden ones.
        pictures: (..., 4) each camera's own picture, pixels; broadcast to `boxes`.

    Returns:
        (...) values in [0, 1].
    """
    inside = area_shares(areas_inside_picture(boxes, pictures), areas(boxes))
    left, top, right, bottom = np.moveaxis((boxes - pictures) * np.array([1.0, 1.0, -1.0, -1.0]), -1, 0)
    height = boxes[..., 3] - boxes[..., 1]
    at_top_or_bottom = _edge_proximity(np.minimum(top, bottom), height)
    at_side = np.minimum(left, right)
    at_side = np.where(at_side < 0.0, 0.0, _edge_proximity(at_side, height))
    width_ratio = np.minimum(area_shares(boxes[..., 2] - boxes[..., 0], _UPRIGHT_ASPECT_RATIO * height), 1.0)
    return np.asarray(
        inside * (1.0 - _EDGE_PENALTY * at_top_or_bottom) * (1.0 - at_side * (1.0 - width_ratio))
    )


def _edge_proximity(gap: Floats, height: Floats) -> Floats:
    """Return how near (...) boxes are to an edge that is `gap` away: 1 at it or beyond, 0 clear of it."""
    margin = np.maximum(_EDGE_MARGIN * height, _MINIMUM_MARGIN)
    return np.asarray(1.0 - np.clip(gap / margin, 0.0, 1.0))
