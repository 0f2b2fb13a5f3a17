"""Reversible jumps: the chain against the enumerated posterior, and people who enter and leave pictures."""

from __future__ import annotations

from itertools import combinations, product
from math import exp

import numpy as np
import pytest

from fakes.tracking.crossings import BLUE, FRAMES, RED, EnterAndLeave
from fakes.tracking.windows import window_of_frames
from tracking import Detections
from tracking.baselines.particles.reversible_jumps import (
    ABSENT,
    CandidatePools,
    ChainLength,
    sample_targets,
)
from tracking.baselines.particles.varying_targets import (
    JumpSettings,
    VaryingTargetsTracker,
    next_presence,
    presence_log_odds,
)
from tracking.boxes import iou


def _pools(rng: np.random.Generator, candidates: int, size: int) -> CandidatePools:
    """Return candidates whose states overlap each other."""
    corners = rng.uniform(0, 12, (candidates, size, 2))
    boxes = np.concatenate([corners, corners + rng.uniform(5, 15, (candidates, size, 2))], axis=-1)
    return CandidatePools(boxes, rng.normal(0.5, 1.5, (candidates, size)), rng.random(candidates) < 0.5)


def _posterior(pools: CandidatePools, weight: float) -> dict[tuple[int, ...], float]:
    """Return the probability of each joint state by enumeration."""
    candidates, size = pools.log_odds.shape
    found = {}
    for state in product(range(ABSENT, size), repeat=candidates):
        present = [n for n in range(candidates) if state[n] != ABSENT]
        log_value = sum(pools.log_odds[n, state[n]] - np.log(size) for n in present)
        for a, b in combinations(present, 2):
            log_value -= weight * float(iou(pools.boxes[a, state[a]], pools.boxes[b, state[b]]))
        found[state] = exp(log_value)
    total = sum(found.values())
    return {state: value / total for state, value in found.items()}


@pytest.mark.parametrize(
    ("seed", "candidates", "size", "weight"),
    [
        (1, 1, 3, 0.0),
        (2, 3, 2, 4.0),
        (3, 4, 2, 8.0),
        (4, 3, 3, 2.0),
        (5, 4, 1, 8.0),
    ],
)
def test_the_chain_samples_the_enumerated_posterior(
    seed: int, candidates: int, size: int, weight: float
) -> None:
    rng = np.random.default_rng(seed)
    pools = _pools(rng, candidates, size)
    exact = _posterior(pools, weight)
    samples = sample_targets(rng, pools, weight, ChainLength(samples=8_000, thinning=2))
    states, counts = np.unique(samples, axis=0, return_counts=True)
    seen = dict(zip(map(tuple, states.tolist()), (counts / len(samples)).tolist(), strict=True))
    assert sum(abs(seen.get(state, 0.0) - share) for state, share in exact.items()) / 2 < 0.04


def test_without_candidates_nobody_is_present() -> None:
    pools = CandidatePools(np.empty((0, 3, 4)), np.empty((0, 3)), np.empty(0, dtype=bool))
    assert sample_targets(np.random.default_rng(1), pools, 1.0, ChainLength(5)).shape == (5, 0)


def test_the_presence_of_one_target_is_that_of_the_exact_filter() -> None:
    """A hidden Markov chain of presence with independent evidence, frame by frame."""
    rng, exact = np.random.default_rng(6), 0.9
    estimate = exact
    for _ in range(12):
        evidence = rng.normal(0.0, 1.5, 4)
        prior = next_presence(exact, 20.0, 5.0)
        weight = prior * np.exp(evidence).mean()
        exact = weight / (weight + 1.0 - prior)
        prior = next_presence(estimate, 20.0, 5.0)
        boxes = np.tile([0.0, 0.0, 5.0, 10.0], (1, 4, 1))
        odds = np.log(prior / (1.0 - prior)) + evidence[None]
        samples = sample_targets(
            rng, CandidatePools(boxes, odds, np.array([False])), 8.0, ChainLength(2000, thinning=6)
        )
        estimate = float((samples[:, 0] != ABSENT).mean())
        assert estimate == pytest.approx(exact, abs=0.05)


def _detections(boxes: list[np.ndarray]) -> Detections:
    return Detections(
        np.array(boxes, dtype=float).reshape(-1, 4),
        np.full(len(boxes), 0.9),
        np.tile([0.5, 0.5], (len(boxes), 1)),
    )


def test_evidence_grows_with_the_overlap_and_falls_with_the_color_distance() -> None:
    box = np.array([10.0, 10.0, 20.0, 40.0])
    seen, settings = _detections([box]), JumpSettings()
    moved = np.array([box, box + 4.0, box + 100.0])
    near, partly, missed = presence_log_odds(0.5, moved, seen, settings)
    assert near == pytest.approx(settings.detection_log_odds)
    assert missed == pytest.approx(-settings.miss_log_odds)
    assert missed < partly < near
    alike, unlike = presence_log_odds(0.5, moved[:2] * 0 + box, seen, settings, np.array([0.0, 0.9]))
    assert alike > near > unlike


def test_people_enter_and_leave_with_their_own_ids() -> None:
    scene, ids = EnterAndLeave((RED, BLUE)), [set(), set()]
    tracker, presence = VaryingTargetsTracker(window_of_frames(6, 3)), []
    for frame in range(FRAMES):
        boxes = [scene.where(person, frame) for person in scene.present(frame)]
        result = tracker.push(frame, _detections(boxes), scene.picture(frame))
        presence.append(tracker.expected_targets)
        for track in result.tracks if result else ():
            for offset, box in enumerate(track.boxes):
                for person in scene.present(result.first + offset):
                    if float(iou(box, scene.where(person, result.first + offset))) > 0.5:
                        ids[person].add(track.id)
    assert [len(numbers) for numbers in ids] == [1, 1]
    assert ids[0] != ids[1]
    assert presence[10] == pytest.approx(1.0, abs=0.1)
    assert presence[20] == pytest.approx(2.0, abs=0.2)
    assert presence[50] == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize(
    "wrong", [{"states": 0}, {"mean_absence_s": 0.0}, {"entry_probability": 1.0}, {"sharpness": 0.0}]
)
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be"):
        JumpSettings(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("wrong", [{"samples": 0}, {"thinning": 0}, {"burn_in": -1}])
def test_an_invalid_length_of_the_chain_is_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="must be"):
        ChainLength(**wrong)
