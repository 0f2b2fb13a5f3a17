"""How much of a person other people leave to be seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.quality.boxes import Floats, areas, shares

_FEET = 0.05
"""Heights by which feet must be lower for somebody to be nearer for sure; boxes do not find feet better."""

_ENOUGH = 0.5
"""The share of a box that has to be left: people do not fill their boxes, and half of one is well seen."""


def unhidden(boxes: Floats, pictures: NDArray[np.int64]) -> Floats:
    """Share of each box that nobody nearer to the camera covers, twice; 1 from a half on.

    Whose feet are lower in the picture is nearer. With *a* somebody else's share of the box and *p*, in
    [0, 1], how surely they are nearer, the share left is the product of ``1 - p a`` over everybody else in
    the picture: several cover each their share of what the others leave. ``p = 1/2 + d / 0.1`` within [0, 1],
    where *d* is how much lower their feet are, in heights of the larger of the two boxes.

    Args:
        boxes: (B, 4) pixels, nobody hidden; all boxes of all pictures, in any order.
        pictures: (B,) which picture each box is in.

    Returns:
        (B,) values in [0, 1].
    """
    free = np.ones(len(boxes))
    left, top, right, bottom = np.ascontiguousarray(boxes.T)
    one, two = _side_by_side(left, right, pictures)
    over = np.flatnonzero(np.minimum(bottom[one], bottom[two]) > np.maximum(top[one], top[two]))
    one, two = one[over], two[over]
    height, area = bottom - top, areas(boxes)
    columns = np.minimum(right[one], right[two]) - np.maximum(left[one], left[two])
    rows = np.minimum(bottom[one], bottom[two]) - np.maximum(top[one], top[two])
    common = columns * rows
    lower = (bottom[two] - bottom[one]) / np.maximum(height[one], height[two])
    nearer = np.clip(0.5 + lower / (2.0 * _FEET), 0.0, 1.0)
    np.multiply.at(free, one, 1.0 - nearer * shares(common, area[one]))
    np.multiply.at(free, two, 1.0 - (1.0 - nearer) * shares(common, area[two]))
    return np.minimum(free / _ENOUGH, 1.0)


def _side_by_side(
    left: Floats, right: Floats, pictures: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """List the pairs of boxes of one picture that share columns, each pair once: two (P,) indices.

    Sorted by picture and left side, a box's partners are those right after it that begin before it ends.
    """
    if not len(left):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    # One axis for all pictures, each its own stretch of it: one sort and one search find all partners.
    low, high = left.min(), max(left.max(), right.max())
    stretch = pictures * (high - low + 1.0) - low
    order = np.argsort(stretch + left, kind="stable")
    begin, end = (stretch + left)[order], (stretch + right)[order]
    here = np.arange(len(order))
    # An empty box ends where it begins, or before.
    last = np.maximum(np.searchsorted(begin, end), here + 1)
    partners = last - here - 1
    one = np.repeat(here, partners)
    two = np.arange(len(one)) - np.repeat(np.cumsum(partners) - partners, partners) + one + 1
    return order[one], order[two]
