"""Appearance histograms: runs of final frames in which no other object is in the box."""

from __future__ import annotations

import numpy as np

from tracking import AppearanceHistogram, Detections, WindowTrack
from tracking.appearance_histograms import add_appearance_histograms

HERE, THERE, BESIDE = (0.0, 0.0, 10.0, 20.0), (200.0, 0.0, 210.0, 20.0), (3.0, 0.0, 13.0, 20.0)


def detections(*boxes: tuple[float, ...]) -> Detections:
    samples = np.eye(4)[: len(boxes)]
    return Detections(np.array(boxes), np.ones(len(boxes)), samples)


def track(number: int, *boxes: tuple[float, ...] | None) -> WindowTrack:
    rows = np.array([box or (np.nan,) * 4 for box in boxes])
    return WindowTrack(number, rows, rows, np.full(4, 0.25), 1.0)


def as_tuples(histograms: tuple[AppearanceHistogram, ...]) -> list[tuple[int, int, list[float]]]:
    return [(mean.first, mean.last, mean.histogram.tolist()) for mean in histograms]


def test_consecutive_frames_are_one_histogram_until_a_crowd_or_an_occlusion() -> None:
    one = track(1, HERE, HERE, HERE, HERE, HERE, HERE)
    two = track(2, THERE, THERE, BESIDE, THERE, None, THERE)
    states = [np.zeros(6, dtype=np.int64), np.array([1, 1, 1, 1, -1, 1])]
    frames = [detections(HERE, THERE), detections(HERE, THERE), detections(HERE, BESIDE)] + [
        detections(HERE, THERE)
    ] * 3
    first, second = add_appearance_histograms([one, two], states, 100, frames)
    assert as_tuples(first.appearance_histograms) == [(100, 101, [1, 0, 0, 0]), (103, 105, [1, 0, 0, 0])]
    assert as_tuples(second.appearance_histograms) == [
        (100, 101, [0, 1, 0, 0]),
        (103, 103, [0, 1, 0, 0]),
        (105, 105, [0, 1, 0, 0]),
    ]


def test_only_final_frames_give_histograms_and_hidden_objects_may_be_in_the_box() -> None:
    one, two = track(1, HERE, HERE, HERE), track(2, BESIDE, THERE, THERE)
    states = [np.zeros(3, dtype=np.int64), np.full(3, -1)]  # the second is hidden, but tracked
    frames = [detections(HERE)] * 2
    first, second = add_appearance_histograms([one, two], states, 7, frames)
    assert as_tuples(first.appearance_histograms) == [(8, 8, [1, 0, 0, 0])]
    assert second.appearance_histograms == ()
    assert add_appearance_histograms([], [], 7, frames) == ()
