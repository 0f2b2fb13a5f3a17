"""Approximate overlap tests of many boxes, on a raster."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_ROWS, _COLUMNS = 36, 64
"""Cells of a picture; boxes touch when they have a cell in common."""


def boxes_touching_others(
    boxes: Floats,
    picture: Ints,
    others: Floats,
    other_pictures: Ints,
    picture_count: int,
    size: tuple[float, float],
) -> Mask:
    """Return which boxes share a raster cell with any other box in the same picture, (V,).

    Args:
        boxes: (V, 4) pixels, without hidden ones.
        picture: (V,) index of the picture of each.
        others: (B, 4) likewise.
        other_pictures: (B,) index of the picture of each.
        picture_count: how many pictures there are.
        size: width and height of each picture, pixels.
    """
    left, top, right, bottom = _cells(others, size)
    edges = np.zeros((picture_count, _ROWS + 1, _COLUMNS + 1), dtype=np.int64)
    for row, column, sign in ((top, left, 1), (bottom, right, 1), (top, right, -1), (bottom, left, -1)):
        np.add.at(edges, (other_pictures, row, column), sign)
    covered = edges.cumsum(axis=1).cumsum(axis=2)[:, :-1, :-1] > 0
    # Summed up from the corner, any rectangle is four look-ups.
    summed = np.zeros_like(edges)
    summed[:, 1:, 1:] = covered.cumsum(axis=1).cumsum(axis=2)
    left, top, right, bottom = _cells(boxes, size)
    inside = summed[picture, bottom, right] + summed[picture, top, left]
    return np.asarray(inside > summed[picture, top, right] + summed[picture, bottom, left])


def _cells(boxes: Floats, size: tuple[float, float]) -> tuple[Ints, Ints, Ints, Ints]:
    """Return the first column and row of each box, and those after its last; clipped to the picture."""
    sides = boxes / np.array([*size, *size]) * np.array([_COLUMNS, _ROWS, _COLUMNS, _ROWS])
    most = np.array([_COLUMNS, _ROWS])
    first = np.clip(np.floor(sides[:, :2]), 0, most).astype(np.int64)
    after = np.clip(np.ceil(sides[:, 2:]), first, most).astype(np.int64)
    return first[:, 0], first[:, 1], after[:, 0], after[:, 1]
