"""How much of a person other people leave to be seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.quality.boxes import Floats, shares

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
    if not len(boxes):
        return np.ones(0)
    order, end = _in_line(boxes, pictures)
    left, top, right, bottom = np.ascontiguousarray(boxes[order].T)
    one, two = _side_by_side(end)
    over = np.flatnonzero((top[two] < bottom[one]) & (top[one] < bottom[two]) & (right[two] > left[one]))
    one, two = one[over], two[over]
    height = bottom - top
    area = height * (right - left)
    columns = np.minimum(right[one], right[two]) - left[two]
    rows = np.minimum(bottom[one], bottom[two]) - np.maximum(top[one], top[two])
    common = np.maximum(columns, 0.0) * rows
    lower = (bottom[two] - bottom[one]) / np.maximum(height[one], height[two])
    nearer = np.clip(0.5 + lower / (2.0 * _FEET), 0.0, 1.0)
    free = np.ones(len(boxes))
    np.multiply.at(free, one, 1.0 - nearer * shares(common, area[one]))
    np.multiply.at(free, two, 1.0 - (1.0 - nearer) * shares(common, area[two]))
    values = np.empty(len(boxes))
    values[order] = np.minimum(free / _ENOUGH, 1.0)
    return values


def _in_line(boxes: Floats, pictures: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Put the boxes in line by picture and left side: their (B,) order, and where in it each one ends."""
    left, right = boxes[:, 0], boxes[:, 2]
    # One axis for all pictures, each its own stretch of it: one sort and one search do for all.
    low, high = left.min(), max(left.max(), right.max())
    stretch = pictures * (high - low + 1.0) - low
    begin = stretch + left
    order = np.argsort(begin, kind="stable")
    return order, np.searchsorted(begin[order], (stretch + right)[order])


def _side_by_side(end: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """List the pairs of boxes in line that share columns, each pair once: two (P,) places in the line.

    A box's partners are those right after it that begin before it ends, at place `end`.
    """
    here = np.arange(len(end))
    # A box without width ends where it begins, or before.
    partners = np.maximum(end - here - 1, 0)
    one = np.repeat(here, partners)
    two = np.arange(len(one)) + np.repeat(here + 1 - np.cumsum(partners) + partners, partners)
    return one, two
