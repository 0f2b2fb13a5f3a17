"""The baseline trackers: they follow easy scenes, reuse no id, and are deterministic."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.strolls import WalkingPerson, detections_at, final_boxes
from fakes.tracking.windows import window_of_frames
from tracking import CostSettings, Detections, WindowResult, create_solver
from tracking.baselines import StepwiseSettings
from tracking.baselines.integral_histograms import BINS, ColorIntegralImage
from tracking.boxes import Floats, iou
from tracking.detectors.base import Image
from tracking.frame_rate import DEFAULT_FPS, frames_in
from tracking.registry import (
    TEMPORAL_TRACKER,
    Tracker,
    create_tracker,
    needs_images,
    tracker_names,
)

WINDOW = window_of_frames(6, 3)
DETECTION_TRACKERS = [name for name in tracker_names() if name != TEMPORAL_TRACKER]
"""All but temporal consistency, which tracks blobs instead of detections and has separate tests."""
SIZE = (120, 200)
_TALL, _WIDE = 40, 18
_COLORS = ((40, 40, 220), (220, 60, 30))


def _tracker(name: str) -> Tracker:
    return create_tracker(name, WINDOW, CostSettings(), lambda: create_solver("columns"))


def _where(person: int, frame: int) -> Floats:
    """Return the box of one of two people who pass at different heights of the picture."""
    left = 15.0 + 2.0 * frame if person == 0 else 160.0 - 2.0 * frame
    top = 8.0 + 60.0 * person
    return np.array([left, top, left + _WIDE, top + _TALL])


def _picture(frame: int, people: int) -> Image:
    rng = np.random.default_rng(5)
    image = rng.integers(90, 130, (*SIZE, 3)).astype(np.uint8)
    texture = np.random.default_rng(6).integers(-25, 25, (_TALL, _WIDE, 1))
    for person in range(people):
        left, top, right, bottom = _where(person, frame).astype(int)
        image[top:bottom, left:right] = np.clip(np.array(_COLORS[person]) + texture, 0, 255)
    return image


def _detections(frame: int, people: int) -> Detections:
    boxes = np.array([_where(person, frame) for person in range(people)]).reshape(-1, 4)
    return Detections(boxes, np.full(people, 0.9), np.tile([0.5, 0.5], (people, 1)))


def _follow(
    tracker: Tracker, frames: int, people: int, missed_frames: range = range(0)
) -> list[WindowResult]:
    """Track people in pictures; in `missed_frames` nothing is detected."""
    results = [
        tracker.push(
            frame, _detections(frame, 0 if frame in missed_frames else people), _picture(frame, people)
        )
        for frame in range(frames)
    ]
    return [result for result in (*results, tracker.flush()) if result is not None]


@pytest.mark.parametrize("name", DETECTION_TRACKERS)
def test_two_people_who_pass_at_a_distance_keep_their_ids(name: str) -> None:
    results = _follow(_tracker(name), 45, 2)
    boxes = final_boxes(results)
    assert {number for row in boxes.values() for number in row} == {1, 2}
    ids_of = {person: set() for person in range(2)}
    for frame, row in boxes.items():
        for number, box in row.items():
            near = [float(iou(box, _where(person, frame))) for person in range(2)]
            assert max(near) > 0.5, f"frame {frame}"
            ids_of[int(np.argmax(near))].add(number)
    assert [len(numbers) for numbers in ids_of.values()] == [1, 1]
    assert sum(len(row) for row in boxes.values()) > 2 * 45 - 12


@pytest.mark.parametrize("name", [name for name in DETECTION_TRACKERS if name != "lp" and needs_images(name)])
def test_image_based_trackers_continue_without_detections(name: str) -> None:
    missed_frames = range(20, 24)
    boxes = final_boxes(_follow(_tracker(name), 45, 1, missed_frames))
    for frame in missed_frames:
        assert [round(float(iou(box, _where(0, frame))), 1) >= 0.5 for box in boxes[frame].values()] == [True]
    assert set(boxes[44]) == {1}


@pytest.mark.parametrize("name", [name for name in DETECTION_TRACKERS if name != "lp" and needs_images(name)])
def test_a_window_without_a_matched_detection_has_the_uniform_histogram(name: str) -> None:
    missed_frames = range(18, 24)
    windows = [
        result for result in _follow(_tracker(name), 30, 1, missed_frames) if result.first in missed_frames
    ]
    unmatched = [track for result in windows for track in result.tracks if track.confidence == 0.0]
    assert unmatched
    for track in unmatched:
        assert track.histogram.tolist() == [0.5, 0.5]


def test_the_kalman_filter_predicts_through_missed_frames_without_publishing() -> None:
    missed_frames = range(20, 26)
    boxes = final_boxes(_follow(_tracker("kalman"), 45, 1, missed_frames))
    assert not any(boxes.get(frame) for frame in missed_frames)
    assert set(boxes[30]) == {1}, "found again at the predicted position"


@pytest.mark.parametrize("name", [name for name in DETECTION_TRACKERS if needs_images(name)])
def test_a_frame_without_a_picture_neither_starts_nor_ends_tracks(name: str) -> None:
    tracker = _tracker(name)
    results = []
    for frame in range(45):
        picture = None if frame < 6 or frame in {20, 21} else _picture(frame, 1)
        results.append(tracker.push(frame, _detections(frame, 1), picture))
    boxes = final_boxes([result for result in (*results, tracker.flush()) if result is not None])
    assert not any(boxes.get(frame) for frame in range(6))
    assert set(boxes[44]) == {1}


@pytest.mark.parametrize("name", [name for name in DETECTION_TRACKERS if name != "lp"])
def test_the_same_pictures_give_the_same_tracks(name: str) -> None:
    def shown(results: list[WindowResult]) -> list[bytes]:
        return [track.boxes.tobytes() for result in results for track in result.tracks]

    assert shown(_follow(_tracker(name), 20, 2)) == shown(_follow(_tracker(name), 20, 2))


def test_an_unknown_tracker_is_refused_with_the_known_names() -> None:
    with pytest.raises(ValueError, match=r"'sort'.*kalman.*lp|'sort'.*lp.*kalman"):
        create_tracker("sort", WINDOW, CostSettings(), lambda: create_solver("columns"))


@pytest.mark.parametrize(
    "wrong",
    [
        {"min_match_iou": 1.5},
        {"min_birth_score": -0.1},
        {"confirm_frames": 0},
        {"max_missed_s": 0.0},
        {"max_unmatched_s": -0.1},
    ],
)
def test_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must be|between 0 and 1"):
        StepwiseSettings(**wrong)  # type: ignore[arg-type]


@st.composite
def streams(draw: st.DrawFn) -> list[tuple[int, Detections]]:
    """Draw detections of people with misses, in frames some of which are skipped."""
    rng = np.random.default_rng(draw(st.integers(0, 1000)))
    people = [
        WalkingPerson(float(rng.integers(0, 300)), 20.0, float(rng.integers(-4, 5)), look)
        for look in range(3)
    ]
    frame, found = draw(st.integers(0, 10)), []
    for _ in range(draw(st.integers(1, 40))):
        present = [person for person in people if rng.random() < 0.8]
        found.append((frame, detections_at(present, frame, jitter=1.5, seed=1)))
        frame += 1 if rng.random() < 0.9 else int(rng.integers(2, 40))
    return found


@given(streams())
@settings(deadline=None, max_examples=40)
def test_every_frame_is_published_once_and_no_id_is_reused(stream: list[tuple[int, Detections]]) -> None:
    tracker = _tracker("kalman")
    pushed = [tracker.push(frame, seen) for frame, seen in stream]
    results = [result for result in (*pushed, tracker.flush()) if result is not None]
    assert results[0].first == stream[0][0]
    assert results[-1].final_to == stream[-1][0]
    for earlier, later in pairwise(results):
        assert later.first == earlier.last + 1
    ends: dict[int, int] = {}
    begins: dict[int, int] = {}
    for result in results:
        for track in result.tracks:
            assert track.boxes.shape == (result.last - result.first + 1, 4)
            assert not np.isnan(track.boxes).all()
            shown = result.first + np.flatnonzero(~np.isnan(track.boxes[:, 0]))
            assert shown[0] > ends.get(track.id, -1)
            assert shown[0] - ends.get(track.id, shown[0]) <= frames_in(
                StepwiseSettings().max_missed_s, DEFAULT_FPS
            )
            begins.setdefault(track.id, int(shown[0]))
            ends[track.id] = int(shown[-1])
    assert sorted(begins) == list(range(1, len(begins) + 1))


@pytest.mark.parametrize("name", DETECTION_TRACKERS)
def test_no_result_spans_a_long_gap_and_ids_are_new_after_it(name: str) -> None:
    tracker, later = _tracker(name), WINDOW.resolve(25.0).forget_after + 12
    before = _follow(tracker, 8, 1)
    results = [tracker.push(frame, _detections(9, 1), _picture(9, 1)) for frame in range(later, later + 9)]
    after = [result for result in (*results, tracker.flush()) if result is not None]
    assert after[0].first == later
    assert after[-1].final_to == later + 8
    numbers = [{track.id for result in results for track in result.tracks} for results in (before, after)]
    assert all(len(ids) == 1 for ids in numbers)
    assert numbers[0] != numbers[1]


def test_a_frame_that_does_not_come_after_the_last_one_is_refused() -> None:
    tracker = _tracker("kalman")
    tracker.push(5, _detections(0, 1))
    with pytest.raises(ValueError, match="frame 5 came after frame 5"):
        tracker.push(5, _detections(0, 1))


@given(st.integers(0, 500), st.lists(st.tuples(*[st.integers(-20, 60)] * 4), min_size=1, max_size=5))
@settings(deadline=None, max_examples=60)
def test_color_histograms_of_boxes_equal_counted_ones(
    seed: int, corners: list[tuple[int, int, int, int]]
) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (30, 40, 3)).astype(np.uint8)
    boxes = np.array([[min(a, c), min(b, d), max(a, c), max(b, d)] for a, b, c, d in corners], dtype=float)
    codes = (image // 64).astype(int) @ np.array([16, 4, 1])
    for box, found in zip(boxes, ColorIntegralImage(image).histograms(boxes), strict=True):
        left, top, right, bottom = np.clip(box, 0, [40, 30, 40, 30]).astype(int)
        inside = codes[top:bottom, left:right].ravel()
        expected = np.bincount(inside, minlength=BINS) / max(inside.size, 1)
        assert np.allclose(found, expected)
