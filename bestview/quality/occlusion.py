"""Occlusion term of view quality: the share of a person that other people do not cover."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.quality.framing import Floats, area_ratios

Ints = NDArray[np.int64]

_FOOT_TOLERANCE = 0.05
"""Heights by which feet must be lower to be certainly nearer: the accuracy of foot points."""

_FULLY_VISIBLE_SHARE = 0.5
"""Uncovered share of a box from which a person counts as fully visible: people do not fill their boxes."""


def occlusion_score(boxes: Floats, cameras: Ints) -> Floats:
    """Return the occlusion score: twice the share of each box that no nearer person covers, at most 1.

    Lower feet in the picture are nearer. With *a* the covered share of the box and *p*, in [0, 1], the
    certainty that the other person is nearer, the share left is the product of ``1 - p a`` over all others,
    in the tracks' order. ``p = 1/2 + d / 0.1`` within [0, 1], where *d* is how much lower their feet are, in
    heights of the larger of the two boxes.

    Args:
        boxes: (T, N, 4) pixels over N frames, NaN where hidden. Fastest where tracks are innermost in memory,
            then frames.
        cameras: (T,) camera of each track.

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
    overlapping = np.flatnonzero((columns > 0.0) & (rows > 0.0))
    intersection = columns.reshape(-1)[overlapping] * rows.reshape(-1)[overlapping]
    frame, pair = np.divmod(overlapping, len(first))
    first_box, second_box = frame * tracks + first[pair], frame * tracks + second[pair]
    height = (bottom - top).reshape(-1)
    area, bottom = height * (right - left).reshape(-1), bottom.reshape(-1)
    depth_order = (bottom[second_box] - bottom[first_box]) / np.maximum(height[first_box], height[second_box])
    nearer = np.clip(0.5 + depth_order / (2.0 * _FOOT_TOLERANCE), 0.0, 1.0)
    visible = np.ones(area.shape)
    # Pairs are sorted by their first track, then their second, so each product is in the order of the tracks.
    np.multiply.at(visible, second_box, 1.0 - (1.0 - nearer) * area_ratios(intersection, area[second_box]))
    np.multiply.at(visible, first_box, 1.0 - nearer * area_ratios(intersection, area[first_box]))
    return np.asarray(np.minimum(visible / _FULLY_VISIBLE_SHARE, 1.0).reshape(frames, tracks).T)


def _overlap_candidates(sides: Floats, cameras: Ints) -> tuple[Ints, Ints]:
    """Return the pairs of tracks of one camera that may overlap: two (P,), each once, lower index first.

    They may if the hulls of their boxes over all frames overlap. People hardly move in a window, so that
    these are few, and tracks are far fewer than boxes. Pairs are sorted by the first track, then by the
    second.

    Args:
        sides: (4, N, T) of the boxes, NaN where hidden.
        cameras: (T,).
    """
    tracks = sides.shape[2]
    visible = np.flatnonzero(~np.isnan(sides[0]).all(axis=0))
    if not visible.size:
        return visible, visible
    left, top = np.fmin.reduce(sides[:2], axis=1)
    right, bottom = np.fmax.reduce(sides[2:], axis=1)
    # All cameras on one axis, each with an interval of its own: one sort and one search serve all.
    start = left[visible].min()
    offset = cameras[visible] * (max(left[visible].max(), right[visible].max()) - start + 1.0) - start
    begin = offset + left[visible]
    order = np.argsort(begin, kind="stable")
    first, second = _overlapping_intervals(
        np.searchsorted(begin[order], (offset + right[visible])[order], side="right")
    )
    in_order = visible[order]
    first, second = in_order[first], in_order[second]
    overlapping = np.flatnonzero((top[second] < bottom[first]) & (top[first] < bottom[second]))
    first, second = first[overlapping], second[overlapping]
    sorted_pairs = np.sort(np.minimum(first, second) * tracks + np.maximum(first, second))
    return sorted_pairs // tracks, sorted_pairs % tracks


def _overlapping_intervals(end: Ints) -> tuple[Ints, Ints]:
    """Return the pairs of sorted intervals that overlap, each pair once: two (P,) indices.

    An interval's partners follow it and start before it ends, at index `end`.
    """
    index = np.arange(len(end))
    # A track without width ends where it begins, or before.
    partners = np.maximum(end - index - 1, 0)
    first = np.repeat(index, partners)
    second = np.arange(len(first)) + np.repeat(index + 1 - np.cumsum(partners) + partners, partners)
    return first, second
