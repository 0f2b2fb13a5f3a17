"""How briskly people move is learned from where they went: walkers stay walkers, sprinters are followed."""

from __future__ import annotations

import numpy as np
import pytest

from tracking.boxes import Floats
from tracking.ground_plane import GroundSettings
from tracking.ground_plane.motion import MotionState, follow
from tracking.ground_plane.motion_scale import MotionScale

ASSUMED = GroundSettings()
SECONDS, NOISE_M = 0.12, 0.1
COVARIANCE, NONE = NOISE_M**2 * np.eye(2), np.zeros((2, 2))


def walk(acceleration: float, seed: int, moves: int = 400) -> Floats:
    """Return the places (F, 2) of somebody whose velocity changes at random, measured with noise."""
    random = np.random.default_rng(seed)
    velocity = np.zeros(2)
    place, places = np.zeros(2), []
    for _ in range(moves):
        velocity = 0.98 * velocity + SECONDS * random.normal(0.0, acceleration, 2)
        place = place + SECONDS * velocity
        places.append(place + random.normal(0.0, NOISE_M, 2))
    return np.array(places)


def learned(places: Floats, scale: MotionScale | None = None) -> MotionScale:
    """Return what is learned, after what a scale knows, from following somebody as the tracker does."""
    scale = scale or MotionScale(ASSUMED)
    state = MotionState.at(places[0], COVARIANCE, scale.settings.speed)
    for place in places[1:]:
        moved = MotionState.stack([state]), np.array([SECONDS]), place[None], COVARIANCE[None]
        scale.learn(scale.move_costs(*moved)[0])
        state = follow(state, SECONDS, place, COVARIANCE, NONE, scale.settings)
    return scale


def factor(scale: MotionScale) -> float:
    return scale.settings.speed / ASSUMED.speed


@pytest.mark.parametrize("seed", range(5))
def test_walkers_are_as_assumed_and_players_are_faster(seed: int) -> None:
    assert factor(learned(walk(0.5, seed))) == 1.0
    assert factor(learned(walk(6.0, seed))) >= 2.0


def test_speed_and_acceleration_grow_together_and_nothing_else_does() -> None:
    settings = learned(walk(6.0, 0)).settings
    assert settings.acceleration / ASSUMED.acceleration == pytest.approx(settings.speed / ASSUMED.speed)
    assert settings.turn_rate == ASSUMED.turn_rate


@pytest.mark.slow
def test_a_court_that_becomes_a_hall_is_learned_anew() -> None:
    scale = learned(walk(6.0, 1))
    for seed in range(20):
        learned(walk(0.5, seed), scale)
    assert factor(scale) == 1.0


def test_two_people_who_are_mixed_up_once_make_nobody_faster() -> None:
    places = walk(0.5, 2)
    places[200:] += [30.0, 0.0]
    assert factor(learned(places)) == 1.0
