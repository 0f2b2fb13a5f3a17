"""Which boxes touch any of others, roughly: on a raster, however many there are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_ROWS, _COLUMNS = 36, 64
"""Cells of a picture; boxes touch when they have a cell in common."""


def boxes_touching_others(
    boxes: Floats, picture: Ints, others: Floats, theirs: Ints, pictures: int, size: tuple[float, float]
) -> Mask:
    """Tell which boxes have a cell in common with any other box in the same picture, (V,).

    Args:
        boxes: (V, 4) pixels, nobody hidden.
        picture: (V,) which picture each is in.
        others: (B, 4) likewise.
        theirs: (B,) which picture each of these is in.
        pictures: how many there are.
        size: width and height of each, pixels.
    """
    left, top, right, bottom = _cells(others, size)
    edges = np.zeros((pictures, _ROWS + 1, _COLUMNS + 1), dtype=np.int64)
    for row, column, sign in ((top, left, 1), (bottom, right, 1), (top, right, -1), (bottom, left, -1)):
        np.add.at(edges, (theirs, row, column), sign)
    covered = edges.cumsum(axis=1).cumsum(axis=2)[:, :-1, :-1] > 0
    # Summed up from the corner, any rectangle is four look-ups.
    summed = np.zeros_like(edges)
    summed[:, 1:, 1:] = covered.cumsum(axis=1).cumsum(axis=2)
    left, top, right, bottom = _cells(boxes, size)
    inside = summed[picture, bottom, right] + summed[picture, top, left]
    return np.asarray(inside > summed[picture, top, right] + summed[picture, bottom, left])


def _cells(boxes: Floats, size: tuple[float, float]) -> tuple[Ints, Ints, Ints, Ints]:
    """Give the first column and row of each box, and the first ones after it; those outside are cut off."""
    sides = boxes / np.array([*size, *size]) * np.array([_COLUMNS, _ROWS, _COLUMNS, _ROWS])
    most = np.array([_COLUMNS, _ROWS])
    first = np.clip(np.floor(sides[:, :2]), 0, most).astype(np.int64)
    after = np.clip(np.ceil(sides[:, 2:]), first, most).astype(np.int64)
    return first[:, 0], first[:, 1], after[:, 0], after[:, 1]
