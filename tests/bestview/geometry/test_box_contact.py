"""Boxes touch those that share a cell of the picture with them, and no others of other pictures."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import boxes_touching_others

SIZE = (640.0, 360.0)
CELL = 10.0


def cells(box: np.ndarray) -> set[tuple[int, int]]:
    """Return the cells that a box touches, in order."""
    return {
        (row, column)
        for row in range(36)
        for column in range(64)
        if box[0] < (column + 1) * CELL
        and box[2] > column * CELL
        and box[1] < (row + 1) * CELL
        and box[3] > row * CELL
    }


def drawn(rng: np.random.Generator, count: int) -> np.ndarray:
    corner = rng.uniform((-40, -40), (660, 380), (count, 2))
    return np.column_stack([corner, corner + rng.uniform(1, 120, (count, 2))])


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(0, 6))
def test_boxes_touch_if_they_share_a_cell(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    boxes, others = drawn(rng, 12), drawn(rng, count)
    picture, theirs = rng.integers(0, 3, 12), rng.integers(0, 3, count)
    told = boxes_touching_others(boxes, picture, others, theirs, 3, SIZE)
    for box, at, touched in zip(boxes, picture, told, strict=True):
        beside = [cells(box) & cells(it) for it, there in zip(others, theirs, strict=True) if there == at]
        assert touched == any(beside)
