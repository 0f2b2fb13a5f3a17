"""The joint particle filter: the exact posterior of two targets, who hides whom, and crossings."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.crossings import RED, Crossing, count_tracked_scenes
from tracking.baselines.particles.joint_particles import (
    JointParticles,
    JointParticleSettings,
    advance_jointly,
    visible_shares,
)
from tracking.baselines.particles.particle_filter import ParticleFilters, ParticleSettings
from tracking.boxes import Floats

SEEDS = range(6)
_CELLS, _STEPS = 5, 6


def _move(rng: np.random.Generator, states: Floats) -> Floats:
    """Move each target by -1, 0 or 1 cells, and stop at the ends."""
    return np.clip(states + rng.integers(-1, 2, states.shape), 0, _CELLS - 1)


def _transition() -> Floats:
    found = np.zeros((_CELLS, _CELLS))
    for cell in range(_CELLS):
        for step in (-1, 0, 1):
            found[cell, min(max(cell + step, 0), _CELLS - 1)] += 1 / 3
    return found


@pytest.mark.parametrize("seed", range(4))
def test_the_particles_have_the_exact_joint_posterior(seed: int) -> None:
    """Two targets on five cells, with evidence that depends on both: the forward filter over 25 states."""
    rng = np.random.default_rng(seed)
    count, transition = 8000, _transition()
    exact = np.zeros((_CELLS, _CELLS))
    exact[1, 3] = 1.0
    states, weights = np.tile([[[1.0], [3.0]]], (count, 1, 1)), np.full(count, 1.0 / count)
    for _ in range(_STEPS):
        evidence = rng.normal(0.0, 1.5, (_CELLS, _CELLS))
        exact = transition.T @ exact @ transition * np.exp(evidence)
        exact /= exact.sum()

        def log_likelihood(joint: Floats, table: Floats = evidence) -> Floats:
            first, second = joint[..., 0].astype(int).T
            return table[first, second]

        states, weights = advance_jointly(rng, states, weights, _move, log_likelihood)
    found = np.zeros_like(exact)
    np.add.at(found, tuple(states[..., 0].astype(int).T), weights)
    assert np.abs(found - exact).sum() / 2 < 0.05


@given(st.integers(0, 2000), st.integers(1, 4))
@settings(deadline=None, max_examples=40)
def test_visible_shares_equal_counted_pixels_where_no_two_hide_the_same(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.integers(0, 20, (count, 2))
    boxes = np.concatenate([corners, corners + rng.integers(1, 12, (count, 2))], axis=1).astype(float)
    for target, share in enumerate(visible_shares(boxes[None])[0]):
        hidden = np.zeros((40, 40), dtype=int)
        for other, (left, top, right, bottom) in enumerate(boxes.astype(int)):
            if (bottom, -other) > (boxes[target, 3], -target):
                hidden[top:bottom, left:right] += 1
        left, top, right, bottom = boxes[target].astype(int)
        inside = hidden[top:bottom, left:right]
        assert share == pytest.approx(1.0 - min(inside.sum() / inside.size, 1.0))


def test_two_similar_people_who_cross_are_kept_where_independent_filters_fail() -> None:
    scenes = [Crossing((RED, RED), seed=seed) for seed in SEEDS]
    joint = count_tracked_scenes([JointParticles(JointParticleSettings(seed=seed)) for seed in SEEDS], scenes)
    alone = count_tracked_scenes([ParticleFilters(ParticleSettings(seed=seed)) for seed in SEEDS], scenes)
    assert joint > alone


def test_a_target_that_is_not_given_any_more_is_marginalized() -> None:
    scene, method = Crossing((RED, RED)), JointParticles()
    people = [method.initialize(scene.picture(0), scene.where(person, 0)) for person in range(2)]
    assert not np.isnan(method.predict(scene.picture(1), people)).any()
    alone = method.predict(scene.picture(2), people[1:])
    assert alone.shape == (1, 4)
    assert float(people[1].weights.sum()) == pytest.approx(1.0)


@pytest.mark.parametrize("wrong", [{"particles": 0}, {"sharpness": 0.0}, {"hidden_distance": 1.5}])
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be"):
        JointParticleSettings(**wrong)  # type: ignore[arg-type]
