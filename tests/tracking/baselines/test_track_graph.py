"""The track graph: members that leave a group, and crossings in which one person is not detected."""

from __future__ import annotations

from itertools import permutations
from math import exp, hypot

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.strolls import BINS, WalkingPerson, detections_at, final_boxes, peaked_histogram
from fakes.tracking.windows import window_of_frames
from tracking import CostSettings, Detections, create_solver
from tracking.appearance import appearance_distance_matrix
from tracking.baselines.track_graphs.track_groups import TrackEndpoint, TrackGraphSettings, departed_member
from tracking.boxes import iou
from tracking.registry import Tracker, create_tracker

CLOSE = 25


def _tracker(name: str) -> Tracker:
    window = window_of_frames(6, 3)
    return create_tracker(name, window, CostSettings(), lambda: create_solver("columns"))


def _end(rng: np.random.Generator, frame: int) -> TrackEndpoint:
    look = rng.dirichlet(np.ones(BINS))
    return TrackEndpoint(
        frame, rng.uniform(0, 100, 2), rng.uniform(-3, 3, 2), float(rng.uniform(40, 90)), look
    )


def _unlike(before: TrackEndpoint, after: TrackEndpoint) -> float:
    distance = float(appearance_distance_matrix(before.histogram[None], after.histogram[None])[0, 0])
    frames = after.frame - before.frame
    if frames > CLOSE:
        return distance
    x, y = after.position - before.position - frames * before.velocity
    return 0.7 * distance + 0.3 * min(hypot(x, y) / before.height, 1.0)


@given(st.integers(0, 5000), st.integers(2, 5))
@settings(deadline=None, max_examples=80)
def test_the_departed_member_is_the_most_probable_of_all_states(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    group = [_end(rng, int(rng.integers(0, 40))) for _ in range(count)]
    leaving_track, remaining_track = _end(rng, 50), _end(rng, 50)
    probabilities = {}
    for leaving, *staying in permutations(range(count)):
        probability = exp(-_unlike(group[leaving], leaving_track))
        if len(staying) == 1:
            probability *= exp(-_unlike(group[staying[0]], remaining_track))
        probabilities[leaving] = probability
    best = max(probabilities, key=lambda member: probabilities[member])
    assert departed_member(group, leaving_track, remaining_track, CLOSE, max_distance=1.0) == best


def test_a_person_unlike_all_members_was_not_in_the_group() -> None:
    place, still = np.zeros(2), np.zeros(2)
    group = [TrackEndpoint(0, place, still, 80.0, peaked_histogram(kind)) for kind in (0, 1)]
    stranger = TrackEndpoint(90, place, still, 80.0, peaked_histogram(5))
    assert departed_member(group, stranger, group[0], CLOSE, max_distance=0.5) is None


def _crossing() -> tuple[list[Detections], list[WalkingPerson]]:
    """Return detections of a person walking past a standing one, who is missed while near the other."""
    standing = WalkingPerson(200.0, 50.0, 0.0, 2, seen=range(1000))
    hidden = {frame for frame in range(200) if abs(50.0 + 3.0 * frame - 200.0) < 30.0}
    walking = WalkingPerson(50.0, 45.0, 3.0, 6)
    frames = [
        detections_at([standing] if frame in hidden else [standing, walking], frame, jitter=0.5, seed=3)
        for frame in range(100)
    ]
    return frames, [standing, walking]


def _numbers(tracker: Tracker, frames: list[Detections], people: list[WalkingPerson]) -> list[list[int]]:
    """Return each person's track numbers in order."""
    pushed = [tracker.push(number, seen) for number, seen in enumerate(frames)]
    results = [result for result in (*pushed, tracker.flush()) if result is not None]
    ids_of_person: list[list[int]] = [[] for _ in people]
    for frame, boxes in sorted(final_boxes(results).items()):
        for number, box in boxes.items():
            near = [float(iou(box, np.array(person.box(frame)))) for person in people]
            ids = ids_of_person[int(np.argmax(near))]
            if max(near) > 0.6 and (not ids or ids[-1] != number):
                ids.append(number)
    return ids_of_person


def test_a_person_who_leaves_a_group_keeps_the_id() -> None:
    frames, people = _crossing()
    assert [len(numbers) for numbers in _numbers(_tracker("track-graph"), frames, people)] == [1, 1]


def test_a_hijacked_track_is_corrected_when_the_group_splits() -> None:
    people = [WalkingPerson(200.0, 50.0, 0.0, 2), WalkingPerson(100.0, 50.0, 1.0, 6)]
    # One person alone is detected: the box moves from the standing to the walking one, with the filter.
    stands, walks = range(82, 112), range(112, 140)
    frames = []
    for frame in range(180):
        present = [people[0]] if frame in stands else [people[1]] if frame in walks else people
        frames.append(detections_at(present, frame, jitter=0.5, seed=4))
    graph, plain = (_numbers(_tracker(name), frames, people) for name in ("track-graph", "kalman"))
    assert graph[0][-1] == graph[0][0]
    assert graph[1][-1] == graph[1][0]
    assert graph[0][0] != graph[1][0]
    assert [plain[0][0] == plain[0][-1], plain[1][0] == plain[1][-1]] != [True, True]


def test_a_frame_has_an_id_at_most_once_and_results_are_deterministic() -> None:
    rng = np.random.default_rng(8)
    people = [
        WalkingPerson(float(rng.integers(0, 300)), 40.0, float(rng.integers(-4, 5)), kind)
        for kind in range(5)
    ]
    frames = []
    for frame in range(200):
        present = [
            person
            for place, person in enumerate(people)
            if not any(abs(person.box(frame)[0] - other.box(frame)[0]) < 14 for other in people[:place])
        ]
        frames.append(detections_at(present, frame % 90, jitter=1.0, seed=frame))
    runs = []
    for _ in range(2):
        tracker = _tracker("track-graph")
        results = [tracker.push(n, seen) for n, seen in enumerate(frames)]
        runs.append([result for result in (*results, tracker.flush()) if result is not None])
    for result in runs[0]:
        numbers = [track.id for track in result.tracks]
        assert len(numbers) == len(set(numbers))
    assert [[track.boxes.tobytes() for track in result.tracks] for result in runs[0]] == [
        [track.boxes.tobytes() for track in result.tracks] for result in runs[1]
    ]


@pytest.mark.parametrize(
    "wrong",
    [
        {"min_covered_share": 0.0},
        {"split_margin": -1.0},
        {"split_decision_s": 0.0},
        {"max_group_s": 0.0},
        {"merge_after_s": 0.0},
    ],
)
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"covered|must be"):
        TrackGraphSettings(**wrong)  # type: ignore[arg-type]
