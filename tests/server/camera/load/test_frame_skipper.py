"""Skipped frames do not break tracks: the tracker receives interpolated detections for them."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from benchmarks.endurance.endless_crowd import crowd
from server.camera.load.frame_skipper import FrameSkipper
from server.camera.load.load_shedder import ShedLevel, shed_levels
from tracking import CostSettings, Detections, OnlineTracker, WindowResult, WindowSettings, create_solver

WINDOW = WindowSettings()
FRAMES = 80


def stepping(bins: int) -> FrameSkipper:
    tracker = OnlineTracker(WINDOW, CostSettings(), create_solver("columns"))
    return FrameSkipper(tracker, bins, WINDOW.stride)


def walker(frame: int) -> Detections:
    """Somebody who walks to the right, two pixels a frame, among what is found elsewhere."""
    noise = np.random.default_rng(frame)
    left = 20.0 + 2.0 * frame + noise.normal(0.0, 0.3)
    looks = np.full((2, 4), 0.25)
    looks[0] = (0.7, 0.1, 0.1, 0.1)
    stray = noise.uniform(0.0, 300.0)
    boxes = np.array([[left, 50.0, left + 24.0, 114.0], [stray, 10.0, stray + 10.0, 40.0]])
    return Detections(boxes, np.array([0.9, 0.35]), looks)


def followed(current: ShedLevel) -> list[WindowResult]:
    steps = stepping(4)
    results = []
    for frame in range(FRAMES):
        searched = current.detects(frame, WINDOW.stride)
        results.append(steps.push(frame, walker(frame)) if searched else steps.skip(frame))
    return [result for result in (*results, steps.flush()) if result is not None]


@pytest.mark.parametrize(
    "current", shed_levels(WINDOW.stride, live=False), ids=lambda level: f"every {level.detection_interval}"
)
def test_a_person_keeps_one_track_however_few_frames_are_searched(current: ShedLevel) -> None:
    results = followed(current)
    assert [result.last for result in results] == [
        result.last for result in followed(ShedLevel())
    ]  # windows end when they do, and none is late
    final = {
        result.first + place: (track.id, track.interpolated[place])
        for result in results
        for track in result.tracks
        for place in range(result.final_to - result.first + 1)
    }
    assert {number for number, _ in final.values()} == {1}
    assert len(final) >= FRAMES - WINDOW.stride
    for frame in range(WINDOW.stride, FRAMES):  # before the first detection there is nothing to interpolate
        assert abs(final[frame][1][0] - (20.0 + 2.0 * frame)) < 3.0


def test_where_every_frame_is_searched_nothing_is_different() -> None:
    scene = list(islice(crowd(3, seed=2), 60))
    tracker = OnlineTracker(WINDOW, CostSettings(), create_solver("columns"))
    steps = stepping(scene[0].histograms.shape[1])
    for frame, seen in enumerate(scene):
        one, other = tracker.push(frame, seen), steps.push(frame, seen)
        assert (one is None) == (other is None)
        if one is not None and other is not None:
            assert [track.id for track in one.tracks] == [track.id for track in other.tracks]
            assert all(
                np.array_equal(a.boxes, b.boxes, equal_nan=True)
                for a, b in zip(one.tracks, other.tracks, strict=True)
            )


def test_windows_of_frames_that_are_all_left_out_end_as_well() -> None:
    steps = stepping(4)
    ends = [
        frame for frame in range(40) if (skipped := steps.skip(frame)) is not None and skipped.last == frame
    ]
    assert ends == list(range(4, 40, 5))


def test_a_window_end_that_never_came_is_in_the_next_result() -> None:
    steps = stepping(4)
    for frame in range(4):
        assert steps.push(frame, walker(frame)) is None
    steps.skip(6)  # 4 and 5 were missed
    steps.skip(7)
    result = steps.push(8, walker(8))
    assert result is not None
    assert (result.first, result.last) == (0, 4)
    following = steps.push(9, walker(9))
    assert following is not None
    assert following.last == 9
