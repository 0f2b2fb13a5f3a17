"""Costs of moves against their definition: walking on, turning, and feet that are in the wrong place."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from tracking.boxes import Floats
from tracking.ground_plane import GroundSettings
from tracking.ground_plane.motion import MotionState, follow, reach_costs

SETTINGS = GroundSettings()
NONE = np.zeros((2, 2))
ALONG_X = np.diag([1.0, 0.0])
"""A camera that looks along the x axis has the feet wrong by a meter."""
NOISE = 0.05**2 * np.eye(2)
SECONDS = 0.12


def walker(speed: float = 1.0) -> MotionState:
    """Return somebody who is at the origin, and walks along the y axis."""
    return MotionState(np.array([0.0, 0.0, 0.0, speed]), np.diag([0.01, 0.01, 0.04, 0.04]))


def cost(place: list[float], misplacement: Floats = NONE) -> float:
    means = np.array([place])
    return float(reach_costs(walker(), SECONDS, means, NOISE[None], misplacement[None], SETTINGS)[0])


@settings(deadline=None)
@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.5))
def test_the_cost_of_a_move_is_of_the_mixture(x: float, y: float) -> None:
    ahead = walker().predict(SECONDS, SETTINGS.acceleration)
    turns, jumps = SETTINGS.turn_probability(SECONDS), SETTINGS.misplacing_probability(SECONDS)
    around = 0.01 * np.eye(2) + NOISE + (SETTINGS.speed * SECONDS) ** 2 * np.eye(2)
    density = (
        (1.0 - turns) * multivariate_normal(ahead.place, ahead.place_covariance + NOISE).pdf([x, y])
        + turns * multivariate_normal([0.0, 0.0], around).pdf([x, y])
        + jumps * multivariate_normal([0.0, 0.0], around + ALONG_X).pdf([x, y])
    )
    assert cost([x, y], ALONG_X) == pytest.approx(-np.log(density))


def test_people_jump_only_along_the_line_of_sight_of_a_camera_that_is_alone() -> None:
    assert cost([2.0, 0.0]) == np.inf, "nobody walks that fast"
    assert cost([0.0, 2.0], ALONG_X) == np.inf
    assert cost([2.0, 0.0], ALONG_X) < 10.0
    assert cost([9.0, 0.0], ALONG_X) == np.inf


def test_a_step_costs_about_the_same_whether_feet_can_be_wrong_or_not() -> None:
    assert cost([0.0, 0.12], ALONG_X) == pytest.approx(cost([0.0, 0.12]), abs=0.05)


def test_after_a_jump_somebody_is_where_they_are_seen_now_and_may_walk_anywhere() -> None:
    place = np.array([2.0, 0.1])
    moved = follow(walker(), SECONDS, place, NOISE, ALONG_X, SETTINGS)
    assert moved.place == pytest.approx(place)
    assert not moved.velocity.any()
    assert moved.velocity_covariance == pytest.approx(SETTINGS.speed**2 * np.eye(2))


def test_a_step_is_no_jump() -> None:
    place = np.array([0.02, 0.14])
    with_doubt, without = (
        follow(walker(), SECONDS, place, NOISE, misplacement, SETTINGS) for misplacement in (ALONG_X, NONE)
    )
    assert (with_doubt.mean == without.mean).all()


@settings(deadline=None)
@given(st.floats(0.5, 60.0))
def test_feet_are_misplaced_as_often_at_any_frame_rate(fps: float) -> None:
    fine = (1.0 - SETTINGS.misplacing_probability(1.0 / fps)) ** fps
    assert fine == pytest.approx(1.0 - SETTINGS.misplacing_probability(1.0))
