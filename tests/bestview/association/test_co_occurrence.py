"""The sweep finds every overlapping pair, and index helpers equal nested loops."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview.association.co_occurrence import overlapping_rectangles
from bestview.association.index_ranges import expand_counts, pairs_of_equal_label, sorted_unique
from bestview.association.tracklet_splitter import observation_runs


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 60), st.integers(0, 2**32), st.sampled_from([0.0, 0.5, 5.0]), st.booleans())
def test_every_overlapping_pair_of_rectangles_is_found_once(
    count: int, seed: int, size: float, whole: bool
) -> None:
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 10, (count, 2))
    high = low + rng.uniform(0, size, (count, 2)) * rng.choice([1.0, 100.0], (count, 1), p=[0.9, 0.1])
    if whole:
        # Touching corners, and many rectangles at one place.
        low, high = np.floor(low), np.floor(high)
    one, two = overlapping_rectangles(low, high)
    expected = [
        (i, j)
        for i in range(count)
        for j in range(i + 1, count)
        if (low[i] <= high[j]).all() and (low[j] <= high[i]).all()
    ]
    assert list(zip(one.tolist(), two.tolist(), strict=True)) == expected


@settings(deadline=None, max_examples=100)
@given(st.lists(st.integers(-1, 3), max_size=9))
def test_pairs_of_equal_label_are_complete_and_unique(labels: list[int]) -> None:
    one, two = pairs_of_equal_label(np.array(labels, dtype=np.int64))
    expected = {
        (i, j) for j, label in enumerate(labels) for i in range(j) if label >= 0 and labels[i] == label
    }
    found = list(zip(one.tolist(), two.tolist(), strict=True))
    assert len(found) == len(expected)
    assert set(found) == expected


@settings(deadline=None, max_examples=50)
@given(st.lists(st.integers(0, 4), max_size=6))
def test_counts_are_expanded_in_order(counts: list[int]) -> None:
    owner, which = expand_counts(np.array(counts, dtype=np.int64))
    expected = [(i, k) for i, count in enumerate(counts) for k in range(count)]
    assert list(zip(owner.tolist(), which.tolist(), strict=True)) == expected
    assert sorted_unique(np.array(counts, dtype=np.int64)).tolist() == sorted(set(counts))


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 4), st.integers(0, 6), st.integers(0, 2**32), st.booleans())
def test_runs_cover_all_observations_and_end_where_crowding_changes(
    tracks: int, frames: int, seed: int, frame_by_frame: bool
) -> None:
    rng = np.random.default_rng(seed)
    visible, crowded = rng.random((tracks, frames)) < 0.7, rng.random((tracks, frames)) < 0.4
    runs = list(observation_runs(visible, crowded, frame_by_frame=frame_by_frame))
    sightings = [(run.track, column) for run in runs for column in range(run.start, run.stop)]
    assert sightings == [(int(i), int(k)) for i, k in np.argwhere(visible)]
    assert all((crowded[run.track, run.start : run.stop] == run.crowded).all() for run in runs)
    for one, two in pairwise(runs):
        continues = (one.track, one.stop, one.crowded) == (
            two.track,
            two.start,
            two.crowded,
        )
        assert frame_by_frame or not continues
    assert not frame_by_frame or all(run.stop == run.start + 1 for run in runs)
