"""GOP costs from sparse views equal those from all views, frame by frame."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import GopCosts, VisibleViews, select_views, select_views_by_gop

FRAMES, CAMERAS, PEOPLE = 7, 3, 4


def draw_views(seed: int) -> tuple[VisibleViews, NDArray[np.float64]]:
    """Draw views, and return them with their qualities (N, C, K), NaN where there is no view."""
    rng = np.random.default_rng(seed)
    quality = rng.choice([np.nan, 0.1, 0.3, 1.0, rng.random()], (FRAMES, CAMERAS, PEOPLE))
    shown = rng.random((FRAMES, CAMERAS)) < 0.9
    quality[~shown] = np.nan
    frame, camera, person = np.nonzero(~np.isnan(quality))
    line = np.lexsort((person, frame, camera))  # camera by camera, as windows are read
    frame, camera, person = frame[line], camera[line], person[line]
    return VisibleViews(frame, camera, person, quality[frame, camera, person], shown, PEOPLE), quality


def reference_costs(
    views: VisibleViews,
    quality: NDArray[np.float64],
    first: int,
    starts: list[bool],
    weight: NDArray[np.float64],
) -> GopCosts:
    """Sum the costs cell by cell."""
    begins = [n for n, start in enumerate(starts) if start]
    ends = [*begins[1:], len(starts)]
    cost = np.zeros((len(begins), CAMERAS, PEOPLE))
    hidden = np.zeros(cost.shape, dtype=np.bool_)
    frame_weights = np.zeros(len(begins))
    for s, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        for n in range(begin, end):
            frame_weights[s] += weight[n]
        for c, k in np.ndindex(CAMERAS, PEOPLE):
            seen = [n for n in range(begin, end) if not np.isnan(quality[first + n, c, k])]
            gained = 0.0
            for n in seen:
                gained += quality[first + n, c, k] * weight[n]
            missing = not views.available[first + begin : first + end, c].all()
            cost[s, c, k] = np.inf if missing else frame_weights[s] - gained
            hidden[s, c, k] = missing or not seen
    return GopCosts(list(cost), frame_weights, list(hidden))


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 2**32 - 1), st.integers(0, FRAMES - 1), st.data())
def test_gops_cost_the_same_to_the_bit(seed: int, first: int, data: st.DataObject) -> None:
    views, quality = draw_views(seed)
    frames = data.draw(st.integers(1, FRAMES - first))
    starts = [True, *data.draw(st.lists(st.booleans(), min_size=frames - 1, max_size=frames - 1))]
    weight = np.random.default_rng(seed).uniform(0.5, 5.0, frames)
    found = views.gops(first, np.array(starts), weight, mark_hidden=True)
    expected = reference_costs(views, quality, first, starts, weight)
    assert np.array(found.cost).tolist() == np.array(expected.cost).tolist()
    assert np.array(found.hidden).tolist() == np.array(expected.hidden).tolist()
    assert found.frames.tolist() == expected.frames.tolist()


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(0, 3))
def test_selection_by_gop_equals_selection_by_frame(seed: int, minimum_shot_gops: int) -> None:
    views, quality = draw_views(seed)
    rng = np.random.default_rng(seed)
    starts = np.arange(FRAMES) % 3 == 0
    weight, shot_ages = rng.uniform(0.5, 5.0, FRAMES), rng.integers(1, 4, PEOPLE)
    previous = rng.integers(-1, CAMERAS, PEOPLE)
    cost = np.where(views.available[:, :, None], 1.0 - np.nan_to_num(quality), np.inf).transpose(2, 0, 1)
    by_frames = select_views(cost, previous, 0.7, starts, minimum_shot_gops, shot_ages, weight)
    _, costs = select_views_by_gop(
        views.gops(0, starts, weight, mark_hidden=True), previous, 0.7, minimum_shot_gops, shot_ages
    )
    np.testing.assert_allclose(costs, by_frames.costs, rtol=1e-12)


def test_costs_of_a_subset_of_people_are_unchanged() -> None:
    views, _ = draw_views(3)
    starts, weight = np.arange(FRAMES) % 2 == 0, np.ones(FRAMES)
    all_people, some = (
        views.gops(0, starts, weight, mark_hidden=True),
        views.gops(0, starts, weight, mark_hidden=True).for_people(np.array([1, 3])),
    )
    assert np.array(some.cost).tolist() == np.array(all_people.cost)[:, :, [1, 3]].tolist()
    assert np.array(some.hidden).tolist() == np.array(all_people.hidden)[:, :, [1, 3]].tolist()
