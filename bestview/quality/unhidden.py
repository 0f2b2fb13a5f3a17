"""How much of a person other people leave to be seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.quality.boxes import Floats, areas, shares

_FEET = 0.05
"""Heights by which feet must be lower for somebody to be nearer for sure; boxes do not find feet better."""


def unhidden(boxes: Floats, pictures: NDArray[np.int64]) -> Floats:
    """Share of each box that nobody nearer to the camera covers.

    Whose feet are lower in the picture is nearer. With *a* somebody else's share of the box and *p*, in
    [0, 1], how surely they are nearer, the term is the product of ``1 - p a`` over everybody else in the
    picture: several cover each their share of what the others leave. ``p = 1/2 + d / 0.1`` within [0, 1],
    where *d* is how much lower their feet are, in heights of the larger of the two boxes.

    Args:
        boxes: (B, 4) pixels, nobody hidden; all boxes of all pictures, in any order.
        pictures: (B,) which picture each box is in.

    Returns:
        (B,) values in [0, 1].
    """
    left = np.ones(len(boxes))
    one, two = _side_by_side(boxes, pictures)
    if not one.size:
        return left
    first, second = boxes[one], boxes[two]
    shared = np.concatenate([np.maximum(first, second)[:, :2], np.minimum(first, second)[:, 2:]], axis=1)
    common = areas(shared)
    over = np.flatnonzero(common > 0)
    one, two, common = one[over], two[over], common[over]
    area = areas(boxes)
    height = boxes[:, 3] - boxes[:, 1]
    lower = (boxes[two, 3] - boxes[one, 3]) / np.maximum(height[one], height[two])
    nearer = np.clip(0.5 + lower / (2.0 * _FEET), 0.0, 1.0)
    np.multiply.at(left, one, 1.0 - nearer * shares(common, area[one]))
    np.multiply.at(left, two, 1.0 - (1.0 - nearer) * shares(common, area[two]))
    return left


def _side_by_side(boxes: Floats, pictures: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """List the pairs of boxes of one picture that share columns, each pair once: two (P,) indices.

    Sorted by picture and left side, a box's partners are those right after it that begin before it ends.
    """
    order = np.lexsort((boxes[:, 0], pictures))
    picture, begin, end = pictures[order], boxes[order, 0], boxes[order, 2]
    # One axis for all pictures, each its own stretch of it: one search finds all partners.
    low, high = (boxes[:, 0].min(), max(boxes[:, 0].max(), boxes[:, 2].max())) if len(boxes) else (0.0, 0.0)
    stretch = picture * (high - low + 1.0) - low
    here = np.arange(len(order))
    last = np.maximum(np.searchsorted(stretch + begin, stretch + end), here + 1)
    partners = last - here - 1
    one = np.repeat(here, partners)
    two = np.arange(len(one)) - np.repeat(np.cumsum(partners) - partners, partners) + one + 1
    return order[one], order[two]
