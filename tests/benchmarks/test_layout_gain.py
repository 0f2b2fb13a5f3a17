"""Who walks together, what parting costs, and the tracker that knows the truth."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.layout_gain.companions import (
    CompanionSettings,
    CompanionTracker,
    departure_costs,
    find_companion,
)
from benchmarks.layout_gain.ground_layout import GroundLayoutTracker, HeightFit
from benchmarks.layout_gain.true_positions import TruePositionTracker, true_boxes, true_companions
from tracking import CostSettings, Detections, OnlineTracker, WindowSettings, create_solver
from tracking.boxes import Floats
from tracking.motchallenge import MotRow

FPS = 10.0
HEIGHT = 100.0
SETTINGS = CompanionSettings()


def person_at(x: float, y: float) -> Floats:
    return np.array([x - 20.0, y - HEIGHT, x + 20.0, y])


def path(x: float, speed: float, frames: int = 20) -> dict[int, Floats]:
    """Return the boxes of somebody who walks to the right, `speed` in heights per second."""
    return {t: person_at(x + HEIGHT * speed * t / FPS, 300.0) for t in range(frames)}


def test_who_walks_side_by_side_is_expected_there() -> None:
    found = find_companion(path(160.0, 1.0), path(100.0, 1.0), FPS, SETTINGS)
    assert found is not None
    assert found.offset == pytest.approx([60.0, 0.0])
    assert (found.height, found.last) == (HEIGHT, 19)


@pytest.mark.parametrize(
    ("x", "speeds"),
    [(60.0, (1.0, 0.5)), (60.0, (1.0, -1.0)), (60.0, (0.0, 0.0)), (300.0, (1.0, 1.0))],
    ids=["parts", "meets", "stands", "far"],
)
def test_who_parts_or_stands_or_is_far_away_is_no_companion(x: float, speeds: tuple[float, float]) -> None:
    assert find_companion(path(100.0 + x, speeds[0]), path(100.0, speeds[1]), FPS, SETTINGS) is None


def test_costs_of_parting_are_those_of_each_box() -> None:
    rng = np.random.default_rng(1)
    companion = find_companion(path(160.0, 1.0), path(100.0, 1.0), FPS, SETTINGS)
    assert companion is not None
    boxes = np.array([[person_at(*rng.uniform(0, 400, 2)) for _ in range(5)] for _ in range(6)])
    expected = rng.uniform(0, 400, (6, 2))
    expected[2] = np.nan
    costs = departure_costs(boxes, expected, companion, 22, FPS, SETTINGS)
    assert not costs[2].any()
    for m in (0, 1, 3, 4, 5):
        for k in range(5):
            feet = np.array([(boxes[m, k, 0] + boxes[m, k, 2]) / 2, boxes[m, k, 3]])
            off = np.linalg.norm(feet - expected[m]) / HEIGHT - 0.15 - 0.15 * (22 + m - 19) / FPS
            assert costs[m, k] == pytest.approx(0.3 * min(max(off / 0.5, 0.0), 1.0))


def test_people_have_companions_in_the_truth_while_they_walk_together() -> None:
    walks = {1: path(100.0, 1.0, 40), 2: path(160.0, 1.0, 40), 3: path(900.0, -2.0, 40)}
    rows = [MotRow.of_box(t + 1, i, box.tolist()) for i, boxes in walks.items() for t, box in boxes.items()]
    found = true_companions(true_boxes(rows), FPS)
    assert min(found) == 10
    assert set.union(*found.values()) == {1, 2}


def test_heights_grow_with_the_distance_below_the_horizon() -> None:
    """A step of half a height is as long for who is near as for who is far, to the side and ahead."""
    fit = HeightFit()
    rows = np.linspace(150.0, 500.0, 60)
    tall = 0.5 * (rows - 100.0)
    people = np.stack([300.0 - 0.2 * tall, rows - tall, 300.0 + 0.2 * tall, rows], axis=1)
    fit.add(people)
    sideways = people + np.outer(0.5 * tall, [1.0, 0.0, 1.0, 0.0])
    np.testing.assert_allclose(fit.places(sideways)[:, 0] - fit.places(people)[:, 0], 0.5, atol=1e-9)
    nearer = people + np.outer(0.01 * tall, [0.0, 1.0, 0.0, 1.0])
    np.testing.assert_allclose(fit.places(nearer)[:, 1] - fit.places(people)[:, 1], 0.01, rtol=0.01)


def test_of_few_people_all_are_as_high() -> None:
    fit = HeightFit()
    fit.add(np.stack([person_at(100.0, 300.0), person_at(200.0, 400.0)]))
    places = fit.places(np.stack([person_at(100.0, 300.0), person_at(200.0, 300.0)]))
    np.testing.assert_allclose(places, [[1.0, 3.0], [2.0, 3.0]])


def test_trackers_of_people_apart_are_the_online_tracker() -> None:
    """Nobody has a companion, and everybody is where the truth says."""
    walks = {1: path(100.0, 1.0, 40), 2: path(900.0, -1.0, 40)}
    rows = [MotRow.of_box(t + 1, i, box.tolist()) for i, boxes in walks.items() for t, box in boxes.items()]
    settings = WindowSettings(), CostSettings(), create_solver("columns"), FPS
    trackers = [
        OnlineTracker(*settings),
        CompanionTracker(*settings, companions=SETTINGS),
        GroundLayoutTracker(*settings, weight=1e-3),
        TruePositionTracker(*settings, people=true_boxes(rows), applies=None),
    ]
    for t in range(40):
        boxes = np.stack([walks[1][t], walks[2][t]])
        results = [one.push(t, Detections(boxes, np.ones(2), np.empty((2, 0)))) for one in trackers]
        ids = [[track.id for track in result.tracks] if result else None for result in results]
        assert all(found == ids[0] for found in ids)


def test_the_truth_tells_apart_two_who_meet_and_turn_back() -> None:
    """They are alike, and nobody sees them while they meet: by their motion they would go on."""
    x = 60.0 * np.abs(np.arange(60) - 30.0) / 10.0 + 10.0
    seen = [np.stack([person_at(500.0 - d, 300.0), person_at(500.0 + d, 300.0)]) for d in x]
    rows = [MotRow.of_box(t + 1, i + 1, boxes[i].tolist()) for t, boxes in enumerate(seen) for i in (0, 1)]
    tracker = TruePositionTracker(
        WindowSettings(), CostSettings(), create_solver("columns"), FPS, people=true_boxes(rows), applies=None
    )
    last = None
    for t, boxes in enumerate(seen):
        shown = boxes if abs(t - 30) > 4 else boxes[:0]
        result = tracker.push(t, Detections(shown, np.ones(len(shown)), np.empty((len(shown), 0))))
        last = result or last
    assert last is not None
    assert [(track.id, track.boxes[-1, 0] < 480.0) for track in last.tracks] == [(1, True), (2, False)]
