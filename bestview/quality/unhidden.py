"""How much of a person other people leave to be seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.quality.boxes import Floats, shares

Ints = NDArray[np.int64]

_FEET = 0.05
"""Heights by which feet must be lower for somebody to be nearer for sure; boxes do not find feet better."""

_ENOUGH = 0.5
"""The share of a box that has to be left: people do not fill their boxes, and half of one is well seen."""


def unhidden(boxes: Floats, cameras: Ints) -> Floats:
    """Share of each box that nobody nearer to the camera covers, twice; 1 from a half on.

    Whose feet are lower in the picture is nearer. With *a* somebody else's share of the box and *p*, in
    [0, 1], how surely they are nearer, the share left is the product of ``1 - p a`` over everybody else in
    the picture, in the tracks' order: several cover each their share of what the others leave.
    ``p = 1/2 + d / 0.1`` within [0, 1], where *d* is how much lower their feet are, in heights of the larger
    of the two boxes.

    Args:
        boxes: (T, N, 4) pixels over N frames, NaN where hidden; fastest where each side is contiguous.
        cameras: (T,) in whose pictures the boxes of each track are.

    Returns:
        (T, N) values in [0, 1]; 1 where hidden.
    """
    sides = [np.ascontiguousarray(boxes[..., side]) for side in range(4)]
    first, second = _near(boxes, cameras)
    left, top, right, bottom = sides
    over = (left[second] < right[first]) & (left[first] < right[second])
    over &= (top[second] < bottom[first]) & (top[first] < bottom[second])
    pair, frame = np.nonzero(over)
    one, two = (tracks[pair] * boxes.shape[1] + frame for tracks in (first, second))
    left, top, right, bottom = (side.reshape(-1) for side in sides)
    height = bottom - top
    area = height * (right - left)
    columns = np.minimum(right[one], right[two]) - np.maximum(left[one], left[two])
    rows = np.minimum(bottom[one], bottom[two]) - np.maximum(top[one], top[two])
    common = columns * rows
    lower = (bottom[two] - bottom[one]) / np.maximum(height[one], height[two])
    nearer = np.clip(0.5 + lower / (2.0 * _FEET), 0.0, 1.0)
    free = np.ones(area.shape)
    # Pairs are in line by their first track, then their second: who comes before a box, then who comes after.
    np.multiply.at(free, two, 1.0 - (1.0 - nearer) * shares(common, area[two]))
    np.multiply.at(free, one, 1.0 - nearer * shares(common, area[one]))
    return np.asarray(np.minimum(free / _ENOUGH, 1.0).reshape(boxes.shape[:2]))


def _near(boxes: Floats, cameras: Ints) -> tuple[Ints, Ints]:
    """List the pairs of tracks of one camera that may overlap: two (P,), each pair once, lower index first.

    They do where what each covers in all frames together overlaps. People hardly move in a window, so that
    these are few, and tracks are far fewer than boxes. Pairs are in line by the first, then by the second.
    """
    some = np.flatnonzero(~np.isnan(boxes[..., 0]).all(axis=1))
    if not some.size:
        return some, some
    low = np.fmin.reduce(boxes[..., :2], axis=1)
    high = np.fmax.reduce(boxes[..., 2:], axis=1)
    # One axis for all cameras, each its own stretch of it: one sort and one search do for all.
    start = low[some, 0].min()
    stretch = cameras[some] * (max(low[some, 0].max(), high[some, 0].max()) - start + 1.0) - start
    begin = stretch + low[some, 0]
    order = np.argsort(begin, kind="stable")
    one, two = _side_by_side(np.searchsorted(begin[order], (stretch + high[some, 0])[order], side="right"))
    line = some[order]
    one, two = line[one], line[two]
    over = (low[two, 1] < high[one, 1]) & (low[one, 1] < high[two, 1])
    one, two = np.minimum(one, two)[over], np.maximum(one, two)[over]
    lined = np.sort(one * len(boxes) + two)
    return lined // len(boxes), lined % len(boxes)


def _side_by_side(end: Ints) -> tuple[Ints, Ints]:
    """List the pairs of tracks in line that share columns, each pair once: two (P,) places in the line.

    A track's partners are those right after it that begin before it ends, at place `end`.
    """
    here = np.arange(len(end))
    # A track without width ends where it begins, or before.
    partners = np.maximum(end - here - 1, 0)
    one = np.repeat(here, partners)
    two = np.arange(len(one)) + np.repeat(here + 1 - np.cumsum(partners) + partners, partners)
    return one, two
