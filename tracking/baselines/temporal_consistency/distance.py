"""Distance between blobs of two stages and its cost (section 3.1)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tracking.baselines.temporal_consistency.blobs import Blob
from tracking.baselines.temporal_consistency.settings import TemporalSettings
from tracking.boxes import Floats, intersections

_HEIGHT, _MIDDLE, _WIDTH = 50.0, 2.0, 0.15
"""Parameters of the sigmoid in g(x)."""


def is_nested(first: Floats, second: Floats) -> bool:
    """Return whether one of two boxes `(4,)` lies within the other."""
    contains = bool((first[:2] <= second[:2]).all() and (first[2:] >= second[2:]).all())
    return contains or bool((second[:2] <= first[:2]).all() and (second[2:] >= first[2:]).all())


def stepped_distance_m(
    before: Blob, after: Blob, pixels_per_meter: float, settings: TemporalSettings
) -> float:
    """Return the distance score d_s in meters: two fixed steps, then the gap.

    0 if one box is within the other, `partial_overlap_m` if they overlap, otherwise `no_overlap_m` plus the
    gap.
    """
    if is_nested(before.box, after.box):
        return 0.0
    if float(intersections(before.box, after.box)) > 0.0:
        return settings.partial_overlap_m
    return settings.no_overlap_m + blob_gap(before, after) / pixels_per_meter


def blob_gap(first: Blob, second: Blob) -> float:
    """Return the gap in pixels between two blobs along the line between their centers.

    Between edges, not centers: when a person leaves a crowd, its center moves further than anyone has walked.
    """
    start, end = first.center, second.center
    length = math.hypot(*(end - start).tolist())
    steps = max(math.ceil(length), 1)
    line = start + (end - start) * np.linspace(0.0, 1.0, steps + 1)[:, None]
    leaves = np.flatnonzero(_inside(first, line))
    enters = np.flatnonzero(_inside(second, line))
    # A center, and even the whole line, may lie outside its blob.
    last, next_ = int(leaves[-1]) if leaves.size else 0, int(enters[0]) if enters.size else steps
    return length * max(next_ - last, 0) / steps


def _inside(blob: Blob, points: Floats) -> NDArray[np.bool_]:
    """Return which points `(N, 2)` lie in a blob, `(N,)`."""
    columns, rows = np.floor(points - blob.box[:2]).astype(np.int64).T
    height, width = blob.mask.shape
    within = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    inside = np.zeros(len(points), dtype=np.bool_)
    inside[within] = blob.mask[rows[within], columns[within]] > 0
    return inside


def distance_cost(reach_ratio: float) -> float:
    """Return g(x), x the distance over the reach in that time: x up to 1, then a sigmoid rising to 51."""
    if reach_ratio <= 1.0:
        return reach_ratio
    return _HEIGHT / (math.exp(-(reach_ratio - _MIDDLE) / _WIDTH) + 1.0) + 1.0


def distance_costs(
    before: Sequence[Blob],
    after: Sequence[Blob],
    seconds: float,
    pixels_per_meter: float,
    settings: TemporalSettings,
) -> Floats:
    """Compute f_dist from each blob to each blob `seconds` later, `(B', B)`."""
    allowed = settings.speed_m_s * seconds
    costs = [
        [distance_cost(stepped_distance_m(old, new, pixels_per_meter, settings) / allowed) for new in after]
        for old in before
    ]
    return np.array(costs, dtype=np.float64).reshape(len(before), len(after))
