"""Measures on boxes."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tracking.boxes import (
    areas,
    dice_overlap,
    heights,
    iou,
    mean_corner_distance,
    total_corner_distance,
    widths,
)

SQUARE = np.array([10.0, 20.0, 30.0, 60.0])
coordinate = st.floats(-1000.0, 1000.0)
size = st.floats(0.0, 500.0)
boxes = st.builds(lambda x, y, w, h: np.array([x, y, x + w, y + h]), coordinate, coordinate, size, size)
many = settings(deadline=None, max_examples=100)


def test_sizes_are_in_pixels() -> None:
    assert (widths(SQUARE), heights(SQUARE), areas(SQUARE)) == (20.0, 40.0, 800.0)


def test_a_shift_counts_four_times_in_total_and_once_in_mean_corner_distance() -> None:
    moved = SQUARE + np.array([3.0, -4.0, 3.0, -4.0])
    assert total_corner_distance(SQUARE, moved) == 4 * 7.0
    assert mean_corner_distance(SQUARE, moved) == 7.0


def test_half_a_box_overlaps_by_half_of_the_average_area() -> None:
    moved = SQUARE + np.array([10.0, 0.0, 10.0, 0.0])
    assert dice_overlap(SQUARE, moved) == 0.5
    assert iou(SQUARE, moved) == 1.0 / 3.0


def test_a_box_without_area_overlaps_nothing() -> None:
    nothing = np.zeros(4)
    assert dice_overlap(nothing, nothing) == iou(nothing, nothing) == 0.0


def test_broadcasting_compares_all_pairs() -> None:
    some, others = np.zeros((3, 4)), np.ones((5, 4))
    assert total_corner_distance(some[:, None], others[None]).shape == (3, 5)


@many
@given(first=boxes, second=boxes)
def test_measures_are_symmetric_and_in_range(first: np.ndarray, second: np.ndarray) -> None:
    for measure in (dice_overlap, iou):
        assert measure(first, second) == measure(second, first)
        assert 0.0 <= measure(first, second) <= 1.0 + 1e-9
    assert total_corner_distance(first, second) == total_corner_distance(second, first) >= 0.0
    assert mean_corner_distance(first, first) == 0.0
