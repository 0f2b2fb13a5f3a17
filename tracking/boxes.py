"""Measures on boxes: `(..., 4)` float64 arrays `left, top, right, bottom` in pixels.

All of them broadcast over the leading axes, so `measure(a[:, None], b[None])` compares all pairs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BOX_SIDES = 4
"""Number of sides: left, top, right, bottom."""

Floats = NDArray[np.float64]

_MEAN_SIDES = 0.5
"""From the sum over four sides to the shift of a rigid box: each axis is counted by two sides."""

_CORNERS_PER_SIDE = 2.0
"""Each side of a box bounds two of its corners."""


def widths(boxes: Floats) -> Floats:
    """Return the widths in pixels, shape (...); negative extents count as 0."""
    return np.maximum(boxes[..., 2] - boxes[..., 0], 0.0)


def heights(boxes: Floats) -> Floats:
    """Return the heights in pixels, shape (...); negative extents count as 0."""
    return np.maximum(boxes[..., 3] - boxes[..., 1], 0.0)


def areas(boxes: Floats) -> Floats:
    """Return the areas in square pixels, shape (...)."""
    return widths(boxes) * heights(boxes)


def intersections(first: Floats, second: Floats) -> Floats:
    """Return the areas in square pixels that two boxes share, shape (...)."""
    left_top = np.maximum(first[..., :2], second[..., :2])
    right_bottom = np.minimum(first[..., 2:], second[..., 2:])
    sides = np.maximum(right_bottom - left_top, 0.0)
    return np.asarray(sides[..., 0] * sides[..., 1])


def shares_within(boxes: Floats, others: Floats) -> Floats:
    """Return the share of each box's area that lies within each other box, in [0, 1], shape (N, K)."""
    area = areas(boxes)
    return intersections(boxes[:, None], others[None]) / np.where(area > 0.0, area, 1.0)[:, None]


def dice_overlap(first: Floats, second: Floats) -> Floats:
    """Return the shared over the average area (Dice), in [0, 1], shape (...) (paper II.B, conflict sets)."""
    average = (areas(first) + areas(second)) / 2.0
    return intersections(first, second) / np.where(average > 0.0, average, 1.0)


def iou(first: Floats, second: Floats) -> Floats:
    """Return the intersection over the union, in [0, 1], shape (...)."""
    shared = intersections(first, second)
    union = areas(first) + areas(second) - shared
    return np.asarray(shared / np.where(union > 0.0, union, 1.0))


def total_corner_distance(first: Floats, second: Floats) -> Floats:
    """Return the total city-block distance of the 4 corners in pixels, shape (...) (paper II.B, Fig. 5).

    The distance of a box moved by `(x, y)` is `4 (|x| + |y|)`.
    """
    return _CORNERS_PER_SIDE * _side_distance(first, second)


def mean_corner_distance(first: Floats, second: Floats) -> Floats:
    """Return the mean city-block distance of the corners in pixels, shape (...): d(.) of paper II.B.

    The distance of a box moved by `(x, y)` is `|x| + |y|`.
    """
    return _MEAN_SIDES * _side_distance(first, second)


def corner_distance_in_heights(first: Floats, second: Floats) -> Floats:
    """Return the mean city-block distance of the corners in mean box heights, shape (...)."""
    mean = (heights(first) + heights(second)) / 2.0
    return np.asarray(mean_corner_distance(first, second) / np.where(mean > 0.0, mean, 1.0))


def distance_in_heights(first: Floats, second: Floats) -> Floats:
    """Return the distance between boxes in mean box heights, shape (...).

    Horizontally between centers, vertically the shorter of head and foot distance: one of them may be cut
    off by the border, or occluded.
    """
    across = (first[..., 0] + first[..., 2] - second[..., 0] - second[..., 2]) / 2.0
    down = np.minimum(np.abs(first[..., 3] - second[..., 3]), np.abs(first[..., 1] - second[..., 1]))
    size = np.maximum((heights(first) + heights(second)) / 2.0, 1.0)
    return np.asarray(np.hypot(across, down) / size)


def _side_distance(first: Floats, second: Floats) -> Floats:
    """Return the sum of the distances of the four sides; faster than a sum over the short axis."""
    total = np.abs(first[..., 0] - second[..., 0])
    for side in range(1, BOX_SIDES):
        total = total + np.abs(first[..., side] - second[..., side])
    return np.asarray(total)
