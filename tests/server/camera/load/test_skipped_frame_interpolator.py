"""Skipped frames do not break tracks: the tracker receives interpolated detections for them."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from benchmarks.endurance.endless_crowd import crowd
from server.camera.load.load_shedder import ShedLevel, shed_levels
from server.camera.load.skipped_frame_interpolator import SkippedFrameInterpolator
from tracking import CostSettings, Detections, OnlineTracker, WindowResult, WindowSettings, create_solver

WINDOW = WindowSettings().resolve(25.0)
FRAMES = 80


def interpolator_of(bins: int) -> SkippedFrameInterpolator:
    tracker = OnlineTracker(WINDOW, CostSettings(), create_solver("columns"))
    return SkippedFrameInterpolator(tracker, bins, WINDOW.stride)


def walker(frame: int) -> Detections:
    """Return the detections of a person who walks right at 2 pixels a frame, and a false one elsewhere."""
    noise = np.random.default_rng(frame)
    left = 20.0 + 2.0 * frame + noise.normal(0.0, 0.3)
    histograms = np.full((2, 4), 0.25)
    histograms[0] = (0.7, 0.1, 0.1, 0.1)
    stray = noise.uniform(0.0, 300.0)
    boxes = np.array([[left, 50.0, left + 24.0, 114.0], [stray, 10.0, stray + 10.0, 40.0]])
    return Detections(boxes, np.array([0.9, 0.35]), histograms)


def track_with_skipping(level: ShedLevel) -> list[WindowResult]:
    interpolator = interpolator_of(4)
    results = []
    for frame in range(FRAMES):
        is_detected = level.detects(frame, WINDOW.stride)
        results.append(interpolator.push(frame, walker(frame)) if is_detected else interpolator.skip(frame))
    return [result for result in (*results, interpolator.flush()) if result is not None]


@pytest.mark.parametrize(
    "level", shed_levels(WINDOW.stride, live=False), ids=lambda level: f"every {level.detection_interval}"
)
def test_a_person_keeps_one_track_at_every_detection_interval(level: ShedLevel) -> None:
    results = track_with_skipping(level)
    assert [result.last for result in results] == [
        result.last for result in track_with_skipping(ShedLevel())
    ]  # windows end at the same frames, none late
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


def test_without_skipped_frames_the_tracks_are_the_trackers() -> None:
    scene = list(islice(crowd(3, seed=2), 60))
    tracker = OnlineTracker(WINDOW, CostSettings(), create_solver("columns"))
    interpolator = interpolator_of(scene[0].histograms.shape[1])
    for frame, detections in enumerate(scene):
        expected, actual = tracker.push(frame, detections), interpolator.push(frame, detections)
        assert (expected is None) == (actual is None)
        if expected is not None and actual is not None:
            assert [track.id for track in expected.tracks] == [track.id for track in actual.tracks]
            assert all(
                np.array_equal(a.boxes, b.boxes, equal_nan=True)
                for a, b in zip(expected.tracks, actual.tracks, strict=True)
            )


def test_windows_without_detected_frames_end_in_time() -> None:
    interpolator = interpolator_of(4)
    ends = [
        frame
        for frame in range(40)
        if (skipped := interpolator.skip(frame)) is not None and skipped.last == frame
    ]
    assert ends == list(range(4, 40, 5))


def test_a_window_whose_last_frame_was_missed_ends_with_the_next_frame() -> None:
    interpolator = interpolator_of(4)
    for frame in range(4):
        assert interpolator.push(frame, walker(frame)) is None
    interpolator.skip(6)  # 4 and 5 were missed
    interpolator.skip(7)
    result = interpolator.push(8, walker(8))
    assert result is not None
    assert (result.first, result.last) == (0, 4)
    following = interpolator.push(9, walker(9))
    assert following is not None
    assert following.last == 9
