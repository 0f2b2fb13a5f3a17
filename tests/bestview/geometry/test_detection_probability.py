"""A camera's places where people are not found are learned from people whom others see there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import DetectionProbabilityMap

SIZE = (640.0, 360.0)
HERE, NEAR, FAR = np.array([[310.0, 170.0], [330.0, 170.0], [40.0, 350.0]])


def findable(prior: float = 0.6, few: float = 10.0, many: float = 50.0) -> DetectionProbabilityMap:
    return DetectionProbabilityMap(2, SIZE, prior, few, many)


def look(
    it: DetectionProbabilityMap, place: np.ndarray, *, found: bool, times: int = 1, camera: int = 0
) -> None:
    for _ in range(times):
        it.learn(np.array([camera]), place[None], np.array([found]), 1.0, 1.0)


def share(it: DetectionProbabilityMap, place: np.ndarray, camera: int = 0) -> float:
    return float(it.probability(np.array([camera]), place[None])[0])


def test_an_unknown_camera_has_the_prior_probability() -> None:
    it = findable(prior=0.7)
    assert share(it, HERE) == share(it, FAR, camera=1) == 0.7


def test_a_place_without_detections_gets_a_low_probability_and_others_keep_theirs() -> None:
    it = findable()
    look(it, HERE, found=False, times=200)
    look(it, FAR, found=True, times=200)
    assert share(it, HERE) < 0.05
    assert share(it, NEAR) == share(it, HERE), "places are known to within a cell"
    assert share(it, FAR) > 0.95
    assert share(it, HERE, camera=1) == 0.6, "of another camera that says nothing"


def test_a_camera_without_detections_has_a_low_probability_at_new_places() -> None:
    it = findable()
    look(it, HERE, found=False, times=450)
    assert share(it, FAR) == pytest.approx(50 * 0.6 / 500)


def test_changes_are_learned_sooner_when_old_trials_fade() -> None:
    remembers, forgets = findable(), findable()
    for it, kept in ((remembers, 1.0), (forgets, 0.99)):
        for found in [False] * 500 + [True] * 100:
            it.learn(np.array([0]), HERE[None], np.array([found]), 1.0, kept)
    assert share(remembers, HERE) < 0.25
    assert share(forgets, HERE) > 0.6


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_the_probability_is_the_detection_rate_of_the_cells_around(seed: int) -> None:
    rng = np.random.default_rng(seed)
    it, looks = findable(), []
    for _ in range(4):
        camera, found = rng.integers(0, 2, 30), rng.random(30) < 0.5
        feet = rng.uniform((-20, -20), (660, 380), (30, 2))
        it.learn(camera, feet, found, 5.0, 0.9)
        looks = [(c, place, f, 0.9 * w) for c, place, f, w in looks]
        looks += [(c, place, f, 5.0) for c, place, f in zip(camera, feet, found, strict=True)]
    for camera in (0, 1):
        here = rng.uniform((0, 0), SIZE)
        own = [(w, w * f) for c, _, f, w in looks if c == camera]
        mean = (sum(f for _, f in own) + 50 * 0.6) / (sum(w for w, _ in own) + 50)
        near = [(w, w * f) for c, place, f, w in looks if c == camera and _adjoin(place, here)]
        expected = (sum(f for _, f in near) + 10 * mean) / (sum(w for w, _ in near) + 10)
        assert share(it, here, camera) == pytest.approx(expected)


def _adjoin(one: np.ndarray, two: np.ndarray) -> bool:
    cells = [np.clip(np.floor(it / 20.0), 0, (31, 17)) for it in (one, two)]
    return bool(np.abs(cells[0] - cells[1]).max() <= 1)


def test_trials_can_have_weights() -> None:
    one, other = findable(), findable()
    one.learn(np.zeros(2, int), np.array([HERE, FAR]), np.array([True, False]), np.array([3.0, 7.0]), 1.0)
    look(other, HERE, found=True, times=3)
    look(other, FAR, found=False, times=7)
    assert [share(one, it) for it in (HERE, FAR)] == pytest.approx([share(other, it) for it in (HERE, FAR)])


def trust(it: DetectionProbabilityMap, place: np.ndarray, camera: int = 0) -> float:
    return float(it.trust(np.array([camera]), place[None])[0])


def test_trust_is_the_local_detection_rate_relative_to_the_cameras() -> None:
    it = findable(prior=0.6, few=10.0, many=50.0)
    look(it, FAR, found=True, times=150)
    look(it, HERE, found=False, times=30)
    look(it, HERE, found=True, times=20)
    own = (170 + 30) / (200 + 50)
    assert trust(it, HERE) == pytest.approx((20 + 10 * own) / (50 + 10) / own)
    assert trust(it, FAR) == 1.0
    assert trust(it, HERE, camera=1) == 1.0, "as good as anywhere, as far as is known"


def test_a_camera_with_few_detections_does_not_raise_trust() -> None:
    it = findable()
    look(it, HERE, found=False, times=450)
    assert trust(it, FAR) == pytest.approx(0.06 / 0.5)


def test_a_person_missed_by_a_camera_that_detects_all_others_is_occluded() -> None:
    it = findable(prior=0.93, few=30.0, many=100.0)
    assert trust(it, HERE) == 1.0
    look(it, FAR, found=True, times=45)
    assert 0.0 < trust(it, HERE) < 1.0
    look(it, FAR, found=True, times=60)
    assert trust(it, HERE) == 0.0
