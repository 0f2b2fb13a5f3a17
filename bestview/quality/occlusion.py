"""How much of a person other people leave to be seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.quality.boxes import Floats, area_shares

Ints = NDArray[np.int64]

_FOOT_TOLERANCE = 0.05
"""Heights by which feet must be lower for somebody to be nearer for sure; boxes do not find feet better."""

_FULLY_VISIBLE_SHARE = 0.5
"""The share of a box that has to be left: people do not fill their boxes, and half of one is well seen."""


def unoccluded_share(boxes: Floats, cameras: Ints) -> Floats:
    """Share of each box that nobody nearer to the camera covers, twice; 1 from a half on.

    Whose feet are lower in the picture is nearer. With *a* somebody else's share of the box and *p*, in
    [0, 1], how surely they are nearer, the share left is the product of ``1 - p a`` over everybody else in
    the picture, in the tracks' order: several cover each their share of what the others leave.
    ``p = 1/2 + d / 0.1`` within [0, 1], where *d* is how much lower their feet are, in heights of the larger
    of the two boxes.

    Args:
        boxes: (T, N, 4) pixels over N frames, NaN where hidden. Fastest where tracks are innermost in memory,
            then frames.
        cameras: (T,) in whose pictures the boxes of each track are.

    Returns:
        (T, N) values in [0, 1]; 1 where hidden.
    """
    tracks, frames = boxes.shape[:2]
    if not boxes.size:
        return np.ones((tracks, frames))
    left, top, right, bottom = sides = np.ascontiguousarray(boxes.transpose(2, 1, 0))
    first, second = _overlap_candidates(sides, cameras)
    columns = np.minimum(right[:, first], right[:, second]) - np.maximum(left[:, first], left[:, second])
    rows = np.minimum(bottom[:, first], bottom[:, second]) - np.maximum(top[:, first], top[:, second])
    over = np.flatnonzero((columns > 0.0) & (rows > 0.0))
    common = columns.reshape(-1)[over] * rows.reshape(-1)[over]
    frame, pair = np.divmod(over, len(first))
    one, two = frame * tracks + first[pair], frame * tracks + second[pair]
    height = (bottom - top).reshape(-1)
    area, bottom = height * (right - left).reshape(-1), bottom.reshape(-1)
    lower = (bottom[two] - bottom[one]) / np.maximum(height[one], height[two])
    nearer = np.clip(0.5 + lower / (2.0 * _FOOT_TOLERANCE), 0.0, 1.0)
    free = np.ones(area.shape)
    # Pairs are in line by their first track, then their second: who comes before a box, then who comes after.
    np.multiply.at(free, two, 1.0 - (1.0 - nearer) * area_shares(common, area[two]))
    np.multiply.at(free, one, 1.0 - nearer * area_shares(common, area[one]))
    return np.asarray(np.minimum(free / _FULLY_VISIBLE_SHARE, 1.0).reshape(frames, tracks).T)


def _overlap_candidates(sides: Floats, cameras: Ints) -> tuple[Ints, Ints]:
    """List the pairs of tracks of one camera that may overlap: two (P,), each pair once, lower index first.

    They do where what each covers in all frames together overlaps. People hardly move in a window, so that
    these are few, and tracks are far fewer than boxes. Pairs are in line by the first, then by the second.

    Args:
        sides: (4, N, T) of the boxes, NaN where hidden.
        cameras: (T,).
    """
    tracks = sides.shape[2]
    some = np.flatnonzero(~np.isnan(sides[0]).all(axis=0))
    if not some.size:
        return some, some
    left, top = np.fmin.reduce(sides[:2], axis=1)
    right, bottom = np.fmax.reduce(sides[2:], axis=1)
    # One axis for all cameras, each its own stretch of it: one sort and one search do for all.
    start = left[some].min()
    stretch = cameras[some] * (max(left[some].max(), right[some].max()) - start + 1.0) - start
    begin = stretch + left[some]
    order = np.argsort(begin, kind="stable")
    one, two = _overlapping_intervals(
        np.searchsorted(begin[order], (stretch + right[some])[order], side="right")
    )
    line = some[order]
    one, two = line[one], line[two]
    over = np.flatnonzero((top[two] < bottom[one]) & (top[one] < bottom[two]))
    one, two = one[over], two[over]
    lined = np.sort(np.minimum(one, two) * tracks + np.maximum(one, two))
    return lined // tracks, lined % tracks


def _overlapping_intervals(end: Ints) -> tuple[Ints, Ints]:
    """List the pairs of tracks in line that share columns, each pair once: two (P,) places in the line.

    A track's partners are those right after it that begin before it ends, at place `end`.
    """
    here = np.arange(len(end))
    # A track without width ends where it begins, or before.
    partners = np.maximum(end - here - 1, 0)
    one = np.repeat(here, partners)
    two = np.arange(len(one)) + np.repeat(here + 1 - np.cumsum(partners) + partners, partners)
    return one, two
