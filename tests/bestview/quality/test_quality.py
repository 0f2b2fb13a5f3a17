"""Size quality: larger views are better, and a hidden person has quality 0."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import HIDDEN_COST, size_quality, view_cost


def test_a_box_over_the_whole_picture_is_perfect_and_a_hidden_one_costs_most() -> None:
    boxes = np.array([[0, 0, 100, 50], [np.nan] * 4, [0, 0, 50, 25]], float)
    quality = size_quality(boxes, 100, 50)
    assert quality.tolist() == [1.0, 0.0, 0.5]
    assert view_cost(quality).tolist() == [0.0, HIDDEN_COST, 0.5]


def test_only_the_part_inside_the_picture_counts() -> None:
    boxes = np.array([[-50, 0, 50, 50], [200, 0, 300, 50], [60, 0, 40, 50]], float)
    assert size_quality(boxes, 100, 50) == pytest.approx([np.sqrt(0.5), 0.0, 0.0])


@settings(deadline=None, max_examples=100)
@given(st.lists(st.floats(-1e4, 1e4), min_size=4, max_size=4), st.floats(1, 4000), st.floats(1, 4000))
def test_quality_and_cost_lie_between_0_and_1(box: list[float], width: float, height: float) -> None:
    quality = size_quality(np.array(box), width, height)
    assert 0.0 <= quality <= 1.0 + 1e-12
    assert 0.0 <= view_cost(quality) <= 1.0


def test_invalid_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="no area"):
        size_quality(np.zeros((1, 4)), 0, 10)
    with pytest.raises(ValueError, match="shape"):
        size_quality(np.zeros((1, 3)), 10, 10)
