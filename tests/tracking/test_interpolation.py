"""Detections of a skipped frame are interpolated from those of the frames around it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracking import Detections, interpolate_detections


def detections(
    *boxes: tuple[float, float, float, float], scores: tuple[float, ...] = (), bins: int = 2
) -> Detections:
    count = len(boxes)
    given_scores = np.array(scores or (0.9,) * count)
    histograms = np.zeros((count, bins))
    histograms[:, :1] = 1.0
    return Detections(np.array(boxes, dtype=np.float64).reshape(-1, 4), given_scores, histograms)


def test_a_walking_person_is_halfway_in_the_middle() -> None:
    between = interpolate_detections(
        detections((0, 0, 10, 30), scores=(0.5,)), detections((4, 2, 14, 32)), 0.5
    )
    assert between.boxes.tolist() == [[2, 1, 12, 31]]
    assert between.scores.tolist() == [0.5]


def test_two_people_who_pass_each_other_are_not_swapped() -> None:
    between = interpolate_detections(
        detections((0, 0, 10, 30), (30, 0, 40, 30)), detections((27, 0, 37, 30), (3, 0, 13, 30)), 1 / 3
    )
    assert between.boxes[:, 0] == pytest.approx([29.0, 1.0])


def test_unmatched_detections_are_not_interpolated() -> None:
    assert len(interpolate_detections(detections((0, 0, 10, 30)), detections((50, 0, 60, 30)), 0.5)) == 0
    assert len(interpolate_detections(detections(), detections((50, 0, 60, 30)), 0.5)) == 0
    assert interpolate_detections(detections((0, 0, 10, 30)), detections(bins=2), 0.5).histograms.shape == (
        0,
        2,
    )


sides = st.tuples(st.integers(0, 60), st.integers(0, 60), st.integers(4, 30), st.integers(4, 60))


@given(st.lists(sides, max_size=6), st.lists(sides, max_size=6), st.floats(0, 1))
def test_each_detection_is_interpolated_once_and_lies_between(
    first: list[tuple[int, int, int, int]], second: list[tuple[int, int, int, int]], share: float
) -> None:
    before, after = (detections(*((x, y, x + w, y + h) for x, y, w, h in some)) for some in (first, second))
    between = interpolate_detections(before, after, share)
    assert len(between) <= min(len(before), len(after))
    starts = (between.boxes[:, None] - share * after.boxes[None]) / max(1.0 - share, 1e-9)
    if share < 0.99 and len(between):
        origin = np.abs(starts[:, :, None] - before.boxes[None, None]).max(axis=-1)
        assert (origin.min(axis=(1, 2)) < 1e-6).all()
