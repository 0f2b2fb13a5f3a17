"""Places where a camera misses people are learned from people that other cameras see there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import DetectionProbabilityMap

SIZE = (640.0, 360.0)
HERE, NEAR, FAR = np.array([[310.0, 170.0], [330.0, 170.0], [40.0, 350.0]])


def new_map(prior: float = 0.6, few: float = 10.0, many: float = 50.0) -> DetectionProbabilityMap:
    return DetectionProbabilityMap(2, SIZE, prior, few, many)


def learn_trials(
    probabilities: DetectionProbabilityMap, place: np.ndarray, *, found: bool, times: int = 1, camera: int = 0
) -> None:
    for _ in range(times):
        probabilities.learn(np.array([camera]), place[None], np.array([found]), 1.0, 1.0)


def share(probabilities: DetectionProbabilityMap, place: np.ndarray, camera: int = 0) -> float:
    return float(probabilities.probability(np.array([camera]), place[None])[0])


def test_an_unknown_camera_has_the_prior_probability() -> None:
    probabilities = new_map(prior=0.7)
    assert share(probabilities, HERE) == share(probabilities, FAR, camera=1) == 0.7


def test_a_place_without_detections_gets_a_low_probability_and_others_keep_theirs() -> None:
    probabilities = new_map()
    learn_trials(probabilities, HERE, found=False, times=200)
    learn_trials(probabilities, FAR, found=True, times=200)
    assert share(probabilities, HERE) < 0.05
    assert share(probabilities, NEAR) == share(probabilities, HERE), "both are in neighboring cells"
    assert share(probabilities, FAR) > 0.95
    assert share(probabilities, HERE, camera=1) == 0.6, "another camera is not affected"


def test_a_camera_without_detections_has_a_low_probability_at_new_places() -> None:
    probabilities = new_map()
    learn_trials(probabilities, HERE, found=False, times=450)
    assert share(probabilities, FAR) == pytest.approx(50 * 0.6 / 500)


def test_changes_are_learned_sooner_when_old_trials_fade() -> None:
    remembers, forgets = new_map(), new_map()
    for probabilities, kept in ((remembers, 1.0), (forgets, 0.99)):
        for found in [False] * 500 + [True] * 100:
            probabilities.learn(np.array([0]), HERE[None], np.array([found]), 1.0, kept)
    assert share(remembers, HERE) < 0.25
    assert share(forgets, HERE) > 0.6


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_the_probability_is_the_detection_rate_of_the_cells_around(seed: int) -> None:
    rng = np.random.default_rng(seed)
    probabilities, trials = new_map(), []
    for _ in range(4):
        camera, found = rng.integers(0, 2, 30), rng.random(30) < 0.5
        feet = rng.uniform((-20, -20), (660, 380), (30, 2))
        probabilities.learn(camera, feet, found, 5.0, 0.9)
        trials = [(c, place, f, 0.9 * w) for c, place, f, w in trials]
        trials += [(c, place, f, 5.0) for c, place, f in zip(camera, feet, found, strict=True)]
    for camera in (0, 1):
        here = rng.uniform((0, 0), SIZE)
        camera_trials = [(w, w * f) for c, _, f, w in trials if c == camera]
        camera_rate = (sum(f for _, f in camera_trials) + 50 * 0.6) / (sum(w for w, _ in camera_trials) + 50)
        near = [(w, w * f) for c, place, f, w in trials if c == camera and _adjoin(place, here)]
        expected = (sum(f for _, f in near) + 10 * camera_rate) / (sum(w for w, _ in near) + 10)
        assert share(probabilities, here, camera) == pytest.approx(expected)


def _adjoin(one: np.ndarray, two: np.ndarray) -> bool:
    cells = [np.clip(np.floor(place / 20.0), 0, (31, 17)) for place in (one, two)]
    return bool(np.abs(cells[0] - cells[1]).max() <= 1)


def test_trials_can_have_weights() -> None:
    one, other = new_map(), new_map()
    one.learn(np.zeros(2, int), np.array([HERE, FAR]), np.array([True, False]), np.array([3.0, 7.0]), 1.0)
    learn_trials(other, HERE, found=True, times=3)
    learn_trials(other, FAR, found=False, times=7)
    assert [share(one, place) for place in (HERE, FAR)] == pytest.approx(
        [share(other, place) for place in (HERE, FAR)]
    )


def view_probability(probabilities: DetectionProbabilityMap, place: np.ndarray, camera: int = 0) -> float:
    return float(probabilities.undetected_view_probability(np.array([camera]), place[None])[0])


def test_a_view_is_as_probable_as_the_local_detection_rate_relative_to_the_cameras() -> None:
    probabilities = new_map(prior=0.6, few=10.0, many=50.0)
    learn_trials(probabilities, FAR, found=True, times=150)
    learn_trials(probabilities, HERE, found=False, times=30)
    learn_trials(probabilities, HERE, found=True, times=20)
    camera_rate = (170 + 30) / (200 + 50)
    assert view_probability(probabilities, HERE) == pytest.approx(
        (20 + 10 * camera_rate) / (50 + 10) / camera_rate
    )
    assert view_probability(probabilities, FAR) == 1.0
    assert view_probability(probabilities, HERE, camera=1) == 1.0, "nothing is known of this camera"


def test_a_camera_with_few_detections_does_not_make_views_probable() -> None:
    probabilities = new_map()
    learn_trials(probabilities, HERE, found=False, times=450)
    assert view_probability(probabilities, FAR) == pytest.approx(0.06 / 0.5)


def test_a_person_missed_by_a_camera_that_detects_all_others_is_occluded() -> None:
    probabilities = new_map(prior=0.93, few=30.0, many=100.0)
    assert view_probability(probabilities, HERE) == 1.0
    learn_trials(probabilities, FAR, found=True, times=45)
    assert 0.0 < view_probability(probabilities, HERE) < 1.0
    learn_trials(probabilities, FAR, found=True, times=60)
    assert view_probability(probabilities, HERE) == 0.0
