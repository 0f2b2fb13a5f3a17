"""View selection equals exhaustive search over all allowed sequences."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import NO_VIEW_COST, ViewSelection, select_views

INF = np.inf


def choose(cost: list[list[float]], previous: int, switch_cost: float, cuts: list[bool]) -> list[int]:
    """Select views of one object from its (N, C) costs."""
    choices = select_views(np.array([cost], float), np.array([previous]), switch_cost, np.array(cuts))
    return [int(view) for view in choices.views[0]]


def total_cost(
    cost: NDArray[np.float64],
    views: tuple[int, ...],
    previous: int,
    switch_cost: float,
    weight: NDArray[np.float64] | None = None,
) -> float:
    """Compute the cost of one object's views from its (N, C) costs."""
    total, current = 0.0, previous
    frame_weights = np.ones(len(cost)) if weight is None else weight
    for frame, view in enumerate(views):
        if view < 0:
            total += NO_VIEW_COST * frame_weights[frame]
            continue
        total += cost[frame, view] * frame_weights[frame] + (
            switch_cost if current not in (-1, view) else 0.0
        )
        current = view
    return total


def keeps_minimum_shot(
    cost: NDArray[np.float64],
    views: tuple[int, ...],
    starts: list[int],
    previous: int,
    least: int,
    shot_ages: int,
) -> bool:
    """Return whether every shot is long enough, or left where its camera does not show the object."""
    current, age = previous, shot_ages
    for start, end in pairwise([*starts, len(cost)]):
        view = views[start]
        if view in (-1, current) or current == -1:
            age = age + 1 if view in (-1, current) else 1
        else:
            hidden = bool((cost[start:end, current] >= NO_VIEW_COST).all())
            if age < least and not hidden and np.isfinite(cost[start:end, current]).all():
                return False
            age = 1
        current = view if view >= 0 else current
    return True


def exhaustive(
    cost: NDArray[np.float64],
    previous: int,
    switch_cost: float,
    cuts: list[bool],
    minimum_shot_gops: int = 0,
    shot_ages: int = 1,
    weight: NDArray[np.float64] | None = None,
) -> tuple[float, tuple[int, ...]]:
    """Try all allowed sequences; ties: stay with the camera, else the lowest index."""
    frames, cameras = cost.shape
    bounds = [frame for frame in range(frames) if cuts[frame]] + [frames]
    head: list[int] = []
    for frame in range(bounds[0]):
        continues = previous >= 0 and np.isfinite(cost[frame, previous]) and (frame == 0 or head[-1] >= 0)
        head.append(previous if continues else -1)
    options = []
    for start, end in pairwise(bounds):
        possible = [c for c in range(cameras) if np.isfinite(cost[start:end, c]).all()] or [-1]
        options.append([(view,) * (end - start) for view in possible])

    def rank(views: tuple[int, ...]) -> tuple[float, list[int]]:
        order, current = [], previous
        for view in views:
            order.append(-1 if view in (-1, current) else view)
            current = view if view >= 0 else current
        return total_cost(cost, views, previous, switch_cost, weight), order

    every = [tuple(head) + tuple(v for gop in parts for v in gop) for parts in product(*options)]
    best = min(
        (
            sequence
            for sequence in every
            if keeps_minimum_shot(cost, sequence, bounds[:-1], previous, minimum_shot_gops, shot_ages)
        ),
        key=rank,
    )
    return rank(best)[0], best


# Eighths add up exactly in floating point, so equal sums are equal and the rule for ties is tested too.
EIGHTHS = st.integers(0, 8).map(lambda n: n / 8)
COSTS = st.one_of(EIGHTHS, EIGHTHS, EIGHTHS, st.just(INF))


@st.composite
def windows(
    draw: st.DrawFn, most_frames: int = 5
) -> tuple[NDArray[np.float64], NDArray[np.int64], float, list[bool]]:
    objects, frames, cameras = (
        draw(st.integers(1, 3)),
        draw(st.integers(1, most_frames)),
        draw(st.integers(1, 3)),
    )
    size = objects * frames * cameras
    cost = np.array(draw(st.lists(COSTS, min_size=size, max_size=size))).reshape(objects, frames, cameras)
    ints = st.lists(st.integers(-1, cameras - 1), min_size=objects, max_size=objects)
    cuts = st.lists(st.booleans(), min_size=frames, max_size=frames)
    return cost, np.array(draw(ints)), draw(st.sampled_from([0.0, 0.125, 0.5, 1.0, 2.0])), draw(cuts)


@settings(deadline=None, max_examples=250)
@given(windows())
def test_no_sequence_of_cameras_is_better(
    window: tuple[NDArray[np.float64], NDArray[np.int64], float, list[bool]],
) -> None:
    cost, previous, switch_cost, cuts = window
    choices = select_views(cost, previous, switch_cost, np.array(cuts))
    for k in range(len(cost)):
        best_cost, best = exhaustive(cost[k], int(previous[k]), switch_cost, cuts)
        assert tuple(choices.views[k]) == best
        assert choices.costs[k] == best_cost


@settings(deadline=None, max_examples=250)
@given(windows(most_frames=6), st.integers(0, 4), st.integers(1, 4), st.data())
def test_no_sequence_with_the_minimum_shot_is_better(
    window: tuple[NDArray[np.float64], NDArray[np.int64], float, list[bool]],
    minimum_shot_gops: int,
    age: int,
    data: st.DataObject,
) -> None:
    cost, previous, switch_cost, cuts = window
    frame_weights = st.lists(st.sampled_from([1.0, 1.0, 2.0, 3.5]), min_size=len(cuts), max_size=len(cuts))
    shot_ages, weight = np.full(len(cost), age), np.array(data.draw(frame_weights))
    choices = select_views(cost, previous, switch_cost, np.array(cuts), minimum_shot_gops, shot_ages, weight)
    for k in range(len(cost)):
        best = exhaustive(cost[k], int(previous[k]), switch_cost, cuts, minimum_shot_gops, age, weight)
        assert (choices.costs[k], tuple(choices.views[k])) == best


def test_a_shot_of_unknown_age_may_end() -> None:
    cost, cuts = np.array([[[0.5, 0.0]] * 2]), np.ones(2, bool)
    assert select_views(cost, np.array([0]), 0.25, cuts, minimum_shot_gops=3).views.tolist() == [[1, 1]]
    young = select_views(cost, np.array([0]), 0.25, cuts, minimum_shot_gops=3, shot_ages=np.array([2]))
    assert young.views.tolist() == [[0, 1]], "shown for one GOP more, then left"


def test_a_shot_may_be_short_if_its_camera_loses_the_object() -> None:
    cost, cuts = np.array([[[1.0, 0.25]] * 3]), np.ones(3, bool)
    assert select_views(cost, np.array([0]), 0.25, cuts, 9, np.array([1])).views.tolist() == [[1, 1, 1]]


def test_the_last_frames_can_be_weighted_to_extrapolate() -> None:
    cost, cuts = np.array([[[0.5, 0.5], [0.5, 0.25]]]), np.ones(2, bool)
    assert select_views(cost, np.array([0]), 1.0, cuts).views.tolist() == [[0, 0]]
    extrapolated = select_views(cost, np.array([0]), 1.0, cuts, weight=np.array([1.0, 8.0]))
    assert extrapolated.views.tolist() == [[0, 1]]
    assert extrapolated.costs.tolist() == [0.5 + 1.0 + 8 * 0.25]


@settings(deadline=None, max_examples=100)
@given(windows(), st.integers(0, 3), st.integers(1, 3))
def test_deciding_only_the_first_gops_gives_the_same_views(
    window: tuple[NDArray[np.float64], NDArray[np.int64], float, list[bool]],
    minimum_shot_gops: int,
    decided_gops: int,
) -> None:
    cost, previous, switch_cost, cuts = window
    whole = select_views(cost, previous, switch_cost, np.array(cuts), minimum_shot_gops)
    part = select_views(
        cost, previous, switch_cost, np.array(cuts), minimum_shot_gops, decided_gops=decided_gops
    )
    after = [frame for frame, cut in enumerate(cuts) if cut][decided_gops:]
    assert part.views.shape[1] == (after[0] if after else len(cuts))
    assert np.array_equal(part.views, whole.views[:, : part.views.shape[1]])
    assert np.array_equal(part.costs, whole.costs)


@settings(deadline=None, max_examples=50)
@given(windows())
def test_objects_do_not_influence_each_other(
    window: tuple[NDArray[np.float64], NDArray[np.int64], float, list[bool]],
) -> None:
    cost, previous, switch_cost, cuts = window
    together = select_views(cost, previous, switch_cost, np.array(cuts))
    for k in range(len(cost)):
        alone = select_views(cost[k : k + 1], previous[k : k + 1], switch_cost, np.array(cuts))
        assert np.array_equal(alone.views[0], together.views[k])


def test_a_short_better_view_is_not_worth_a_cut_and_a_long_one_is() -> None:
    short = [[0.5, 0.5], [0.5, 0.1], [0.5, 0.5], [0.5, 0.5]]
    long = [[0.5, 0.5], [0.5, 0.1], [0.5, 0.1], [0.5, 0.1]]
    assert choose(short, 0, 1.0, [True] * 4) == [0, 0, 0, 0]
    assert choose(long, 0, 1.0, [True] * 4) == [0, 1, 1, 1]


def test_without_a_switching_cost_every_frame_takes_its_best_view() -> None:
    assert choose([[0.5, 0.1], [0.1, 0.5], [0.5, 0.1]], 0, 0.0, [True] * 3) == [1, 0, 1]


def test_a_cut_waits_for_the_next_gop() -> None:
    assert choose([[1.0, 0.0]] * 4, 0, 0.5, [False, False, True, False]) == [0, 0, 1, 1]


def test_a_tie_stays_with_the_camera_and_else_takes_the_lowest_index() -> None:
    equal = [[0.5, 0.5, 0.5]] * 3
    assert choose(equal, 1, 0.0, [True] * 3) == [1, 1, 1]
    assert choose(equal, -1, 0.0, [True] * 3) == [0, 0, 0]


def test_a_camera_missing_somewhere_in_a_gop_is_not_cut_to() -> None:
    cost = [[0.9, 0.1], [0.9, 0.1], [0.9, INF], [0.9, 0.1]]
    assert choose(cost, 0, 0.0, [True, False, False, False]) == [0, 0, 0, 0]


def test_a_camera_that_fails_within_a_running_gop_is_shown_until_then() -> None:
    cost = [[0.1, 0.9], [INF, 0.9], [0.1, 0.9], [0.1, 0.9]]
    assert choose(cost, 0, 0.5, [False, False, False, True]) == [0, -1, -1, 0]


def test_a_gap_is_not_a_cut() -> None:
    cost = [[0.5, 0.5], [INF, INF], [0.5, 0.25]]
    assert choose(cost, 0, 0.5, [True] * 3) == [0, -1, 0]


def test_a_stream_cannot_start_within_a_gop() -> None:
    assert choose([[0.1], [0.1], [0.1]], -1, 1.0, [False, True, False]) == [-1, 0, 0]


def test_without_cameras_there_is_no_view() -> None:
    no_objects = select_views(np.zeros((0, 3, 2)), np.zeros(0, int), 1.0, np.ones(3, bool))
    no_cameras = select_views(np.zeros((2, 3, 0)), np.full(2, -1), 1.0, np.ones(3, bool))
    assert no_objects.views.shape == (0, 3)
    assert (no_cameras.views == -1).all()
    assert no_cameras.costs.tolist() == [3.0, 3.0]


def test_arguments_are_not_modified() -> None:
    cost, previous = np.array([[[0.5, 0.1]] * 3]), np.array([0])
    before = cost.copy()
    select_views(cost, previous, 0.1, np.ones(3, bool))
    assert np.array_equal(cost, before)
    assert previous.tolist() == [0]


def test_invalid_arguments_are_refused() -> None:
    cost, cuts = np.zeros((1, 2, 2)), np.ones(2, bool)

    def refused(match: str, *arguments: object) -> None:
        with pytest.raises(ValueError, match=match):
            select_views(*arguments)  # type: ignore[arg-type]

    refused("not a number", np.full((1, 2, 2), np.nan), np.array([0]), 1.0, cuts)
    refused("outside", cost, np.array([2]), 1.0, cuts)
    refused("switching cost", cost, np.array([0]), -1.0, cuts)
    refused("cut_allowed", cost, np.array([0]), 1.0, np.ones(3, bool))
    refused("previous", cost, np.array([0, 1]), 1.0, cuts)
    refused("cost has shape", np.zeros((2, 2)), np.array([0]), 1.0, cuts)
    refused("shot_ages", cost, np.array([0]), 1.0, cuts, 2, np.array([1, 1]))
    refused("weight", cost, np.array([0]), 1.0, cuts, 0, None, np.array([1.0, 0.0]))


def test_a_thousand_objects_are_selected_at_once() -> None:
    rng = np.random.default_rng(7)
    cost = rng.random((1000, 25, 16))
    choices = select_views(cost, rng.integers(-1, 16, 1000), 2.0, np.arange(25) % 5 == 2)
    assert isinstance(choices, ViewSelection)
    assert choices.views.shape == (1000, 25)
