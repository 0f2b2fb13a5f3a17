"""Boxes touch others that share a cell of the same picture."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import boxes_touching_others

SIZE = (640.0, 360.0)
CELL = 10.0


def cells(box: np.ndarray) -> set[tuple[int, int]]:
    """Return the cells that a box touches."""
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
    picture, other_pictures = rng.integers(0, 3, 12), rng.integers(0, 3, count)
    touching = boxes_touching_others(boxes, picture, others, other_pictures, 3, SIZE)
    for box, box_picture, touched in zip(boxes, picture, touching, strict=True):
        shared_cells = [
            cells(box) & cells(other)
            for other, other_picture in zip(others, other_pictures, strict=True)
            if other_picture == box_picture
        ]
        assert touched == any(shared_cells)
