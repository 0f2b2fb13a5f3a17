"""Ground truth of views, the offline optimum, and object matching equal exhaustive search."""

from __future__ import annotations

from itertools import pairwise, permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import NO_PERSON, ViewGroundTruth, assign_objects_one_to_one, optimal_views, view_ground_truth

BOX = [0.0, 0.0, 50.0, 50.0]  # a quarter of a picture of 100 x 100: its size is one half
NOWHERE = [np.nan] * 4
SQUARE, WIDE = [100.0, 100.0], [200.0, 200.0]


def truth_of(boxes: list[list[float]], shown: list[float], least: float = 0.25) -> ViewGroundTruth:
    """Return one person's views in one frame of several cameras."""
    boxes_by_camera = np.array(boxes)[None, None]
    sizes = np.array([SQUARE] * len(boxes))
    return view_ground_truth(boxes_by_camera, np.array(shown)[None, None], sizes, least)


def test_a_view_costs_its_share_below_the_largest_view() -> None:
    boxes = np.array([BOX, BOX])[None, None]
    truth = view_ground_truth(boxes, np.ones((1, 1, 2)), np.array([SQUARE, WIDE]), 0.25)
    assert truth.cost.ravel().tolist() == [0.0, 0.5]
    assert truth.visible.all()


def test_hidden_and_absent_people_cost_one_and_are_not_visible() -> None:
    truth = truth_of([BOX, BOX, NOWHERE, [-9.0, 0.0, -1.0, 9.0]], [0.2, 0.0, 1.0, 1.0])
    assert truth.cost.ravel().tolist() == [1.0] * 4
    assert not truth.visible.any()
    assert not truth.evaluated.any()


def test_views_are_compared_with_the_best_visible_view() -> None:
    truth = truth_of([BOX, [0.0, 0.0, 25.0, 25.0]], [0.1, 1.0])
    assert truth.cost.ravel().tolist() == [1.0, 0.0]


def test_an_unknown_visible_share_counts_as_one_and_the_threshold_is_configurable() -> None:
    assert truth_of([BOX] * 3, [-1.0, 0.25, 1.0]).visible.all()
    assert truth_of([BOX] * 2, [0.0, 0.2], least=0.0).visible.all()
    assert not truth_of([BOX], [0.9], least=1.0).visible.any()


def test_shapes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="shapes"):
        view_ground_truth(np.zeros((1, 1, 2, 4)), np.zeros((1, 1, 2)), np.ones((1, 2)), 0.5)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.1, 0.4, 2.0]))
def test_the_optimum_is_the_cheapest_of_all_sequences(seed: int, switch_cost: float) -> None:
    rng = np.random.default_rng(seed)
    visible = rng.random((2, 5, 3)) < 0.7
    cost = np.where(visible, rng.random((2, 5, 3)), 1.0)
    truth = ViewGroundTruth(cost, visible)
    views = optimal_views(truth, switch_cost)
    for person in range(2):
        on = visible[person].any(axis=1)
        assert (views[person] >= 0).tolist() == on.tolist()
        assert total(cost[person, on], views[person, on].tolist(), switch_cost) == pytest.approx(
            min(
                total(cost[person, on], sequence, switch_cost)
                for sequence in product(range(3), repeat=int(on.sum()))
            )
        )


def total(cost: np.ndarray, views: tuple[int, ...] | list[int], switch_cost: float) -> float:
    view_costs = sum(float(cost[frame, view]) for frame, view in enumerate(views))
    return view_costs + switch_cost * sum(a != b for a, b in pairwise(views))


@settings(deadline=None, max_examples=80)
@given(st.integers(1, 4), st.integers(1, 4), st.integers(0, 10_000))
def test_objects_are_matched_to_people_optimally(people: int, objects: int, seed: int) -> None:
    matches = np.random.default_rng(seed).integers(0, 5, (people, objects))
    found = assign_objects_one_to_one(matches).tolist()
    matched = [person for person in found if person != NO_PERSON]
    assert len(set(matched)) == len(matched), "one person has one object"
    reached = sum(int(matches[person, item]) for item, person in enumerate(found) if person != NO_PERSON)
    square = np.zeros((4, 4), dtype=np.int64)
    square[:people, :objects] = matches
    assert reached == max(
        sum(int(square[a, b]) for b, a in enumerate(order)) for order in permutations(range(4))
    )


def test_an_object_without_matches_has_no_person() -> None:
    assert assign_objects_one_to_one(np.array([[0, 3, 1], [0, 0, 2]])).tolist() == [NO_PERSON, 0, 1]
    assert assign_objects_one_to_one(np.zeros((0, 2), dtype=np.int64)).tolist() == [NO_PERSON, NO_PERSON]
