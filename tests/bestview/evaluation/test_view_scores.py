"""Scores of view selections: the optimum has no regret, and no selection has less."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import score_views, select_views

EVERYWHERE = np.ones((1, 6, 2), dtype=bool)
COST = np.array([[[0.2, 0.8], [0.2, 0.8], [0.2, 0.8], [0.8, 0.2], [0.8, 0.2], [0.8, 0.2]]])


def test_the_optimum_agrees_with_itself_and_has_no_regret() -> None:
    score = score_views(COST, EVERYWHERE, np.array([[0, 0, 0, 1, 1, 1]]), 0.5, 1.0)
    assert (score.agreement, score.regret, score.visible) == (1.0, 0.0, 1.0)
    assert score.cuts_per_minute == score.optimum_cuts_per_minute == 10.0
    assert score.shortest_shot == 0


def test_regret_is_the_share_by_which_a_choice_costs_more() -> None:
    score = score_views(COST, EVERYWHERE, np.array([[0, 0, 0, 0, 0, 0]]), 0.5, 1.0)
    assert score.agreement == 0.5
    assert score.regret == pytest.approx((3.0 - 1.7) / 1.7)


def test_a_frame_without_a_view_costs_one_and_is_no_cut() -> None:
    score = score_views(COST, EVERYWHERE, np.array([[0, -1, 0, 1, 1, 1]]), 0.5, 1.0)
    assert score.regret == pytest.approx(0.8 / 1.7)
    assert score.visible == pytest.approx(5 / 6)
    assert score.cuts_per_minute == 10.0


def test_flicker_shows_in_the_shortest_shot() -> None:
    score = score_views(COST, EVERYWHERE, np.array([[0, 0, 1, 0, 1, 1]]), 0.5, 1.0)
    assert score.shortest_shot == 1
    assert score.cuts_per_minute == 30.0


def test_frames_in_which_no_camera_sees_the_object_do_not_count() -> None:
    visible = EVERYWHERE.copy()
    visible[0, 1:3] = False
    score = score_views(COST, visible, np.array([[0, -1, 1, 1, 1, 1]]), 0.5, 1.0)
    assert score.frames == 4
    assert (score.agreement, score.regret) == (1.0, 0.0)


def test_a_camera_that_does_not_see_the_object_does_not_show_it() -> None:
    visible = EVERYWHERE.copy()
    visible[0, :, 0] = False
    score = score_views(COST, visible, np.array([[0, 0, 0, 1, 1, 1]]), 0.5, 1.0)
    assert score.visible == 0.5


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10_000))
def test_no_selection_beats_the_optimum_and_a_window_comes_close(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cost = rng.random((2, 20, 3))
    visible = np.ones(cost.shape, dtype=bool)
    anything = score_views(cost, visible, rng.integers(-1, 3, (2, 20)), 0.7, 25.0)
    optimum = select_views(cost, np.array([-1, -1]), 0.7, np.ones(20, dtype=bool))
    exact = score_views(cost, visible, optimum.views, 0.7, 25.0)
    assert anything.regret >= 0.0
    assert exact.regret == pytest.approx(0.0, abs=1e-12)
    assert exact.agreement == 1.0


def test_invalid_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="shapes"):
        score_views(COST, EVERYWHERE, np.zeros((1, 5), int), 0.5, 1.0)
    with pytest.raises(ValueError, match="outside"):
        score_views(COST, EVERYWHERE, np.full((1, 6), 2), 0.5, 1.0)


def test_no_objects_score_zero() -> None:
    score = score_views(np.zeros((0, 5, 2)), np.zeros((0, 5, 2), bool), np.zeros((0, 5), int), 0.5, 25.0)
    assert (score.frames, score.regret) == (0, 0.0)
