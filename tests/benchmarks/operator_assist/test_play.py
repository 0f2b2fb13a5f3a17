"""The soccer clips' benchmark: failures, flags one at a time, and particles that a gaze pulls."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.operator_assist.play import (
    PlayClip,
    TargetFailure,
    choose_flags,
    count_play,
    draw_play,
    pull,
    target_failures,
)
from benchmarks.paper_experiments.scene import ObjectTruth
from tracking.baselines.particles.particle_filter import ParticleTarget

FPS = 10.0


def _clip(frames: int) -> PlayClip:
    """Return a clip of two people who stand, without pictures."""
    boxes = np.stack([np.tile([left, 10.0, left + 20, 70.0], (frames, 1)) for left in (0.0, 100.0)])
    return PlayClip("two", [], ObjectTruth(boxes, np.ones((2, frames))), FPS)


def test_a_target_fails_where_it_leaves_its_person_for_a_second() -> None:
    clip = _clip(60)
    tracked = clip.truth.boxes.copy()
    tracked[0, 5:12] += 50.0  # seven frames only
    assert target_failures(clip, tracked) == []
    tracked[0, 30:, :] = clip.truth.boxes[1, 30:]
    assert target_failures(clip, tracked) == [TargetFailure(0, 30)]


def test_a_hidden_person_cannot_fail() -> None:
    clip = _clip(60)
    clip.truth.visible[0, 20:40] = 0.0
    tracked = clip.truth.boxes.copy()
    tracked[0, 20:40] += 50.0
    assert target_failures(clip, tracked) == []


def test_failures_while_another_one_is_flagged_get_no_flag() -> None:
    found = choose_flags([TargetFailure(3, 50), TargetFailure(4, 60), TargetFailure(5, 200)], FPS)
    assert found == {3: range(40, 80), 5: range(190, 230)}


def test_pointing_moves_the_target_to_the_particles_near_the_point() -> None:
    states = np.zeros((100, 5))
    states[:, 0], states[:, 1], states[:, 2] = np.linspace(0.0, 99.0, 100), 50.0, 60.0
    weights = np.zeros(100)
    weights[90] = 1.0
    target = ParticleTarget(np.empty((2, 64)), 0.3, states, weights, np.empty(4))
    pull(target, np.array([0.0, 20.0, 20.0, 80.0]), np.random.default_rng(1))
    assert float(target.weights.sum()) == pytest.approx(1.0)
    assert float(target.weights[:40].sum()) == pytest.approx(0.5, abs=0.01)
    assert float(target.weights @ states[:, 0]) < 60.0


def test_a_short_clip_of_the_court_is_counted() -> None:
    found = count_play(draw_play(seed=1, seconds=0.4, players=2))
    assert (found.targets, found.failures, found.flagged, found.caused) == (2, 0, 0, 0)
