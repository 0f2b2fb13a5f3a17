"""Re-identification by appearance is unambiguous; appearance evidence falls with distance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview.association.affinity.affinity_fusion import select_with_bins_of_newest
from bestview.association.appearance.histograms import HistogramEqualizer, MeanHistogram, PersonAppearance
from bestview.association.appearance.likelihood import AppearanceWeights, DistanceScale, appearance_evidence
from bestview.association.registry.reidentification import (
    appearance_distances,
    match_by_appearance,
    unambiguous_minima,
)

BINS, RATIO = 16, 1.5

COSTS = st.one_of(st.just(np.nan), st.integers(0, 12).map(float))


@st.composite
def people(draw: st.DrawFn) -> list[PersonAppearance]:
    """Draw appearances of some people, each in some of two cameras, with histograms of one of two sizes."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    found = []
    for _ in range(draw(st.integers(0, 5))):
        appearance = PersonAppearance()
        for camera in draw(st.sets(st.sampled_from(["c0", "c1"]))):
            bins = draw(st.sampled_from([BINS, BINS, 2 * BINS]))
            appearance.add(camera, MeanHistogram.of(rng.dirichlet(np.full(bins, 0.3)), 30))
        found.append(appearance)
    return found


def test_histograms_with_other_bins_are_not_compared_with_earlier_ones() -> None:
    old, new = (MeanHistogram.of(np.ones(bins), 30) for bins in (BINS, 2 * BINS))
    assert select_with_bins_of_newest([(0, new), (1, new), (2, old), (3, old)], 2) == [(0, new), (1, new)]
    assert select_with_bins_of_newest([(0, old), (1, new), (2, new)], 2) == [(1, new), (2, new)]
    assert select_with_bins_of_newest([(2, old), (3, old)], 2) == [(2, old), (3, old)]
    assert select_with_bins_of_newest([], 2) == []


@settings(deadline=None, max_examples=200)
@given(st.data())
def test_an_unambiguous_minimum_is_far_below_the_rest_of_its_row_and_column(data: st.DataObject) -> None:
    high, wide = data.draw(st.integers(1, 4)), data.draw(st.integers(1, 4))
    cost = np.array([[data.draw(COSTS) for _ in range(wide)] for _ in range(high)])
    clear = unambiguous_minima(cost, RATIO)
    for i in range(high):
        for j in range(wide):
            rivals = [*np.delete(cost[i], j), *np.delete(cost[:, j], i)]
            worse = all(
                np.isnan(rival) or (rival >= cost[i, j] and rival >= RATIO * cost[i, j]) for rival in rivals
            )
            assert clear[i, j] == (not np.isnan(cost[i, j]) and worse)


@settings(deadline=None, max_examples=100)
@given(people(), people(), st.floats(0.0, 0.3), st.data())
def test_matches_are_one_to_one_and_possible(
    found: list[PersonAppearance], lost: list[PersonAppearance], gate: float, data: st.DataObject
) -> None:
    shape = (len(found), len(lost))
    flat = data.draw(st.lists(st.booleans(), min_size=shape[0] * shape[1], max_size=shape[0] * shape[1]))
    possible = np.array(flat, dtype=np.bool_).reshape(shape)
    distance = appearance_distances(HistogramEqualizer(), found, lost)
    answer = match_by_appearance(distance, possible, gate)
    assert len(answer) == len(found)
    again = [index for index in answer if index >= 0]
    assert len(again) == len(dict.fromkeys(again))
    for new, old in enumerate(answer):
        if old >= 0:
            assert possible[new, old]
            assert distance[new, old] <= gate


@settings(deadline=None, max_examples=100)
@given(people(), people())
def test_appearance_is_compared_in_common_cameras_where_there_are_any(
    found: list[PersonAppearance], lost: list[PersonAppearance]
) -> None:
    distance = appearance_distances(HistogramEqualizer(), found, lost)
    for i, new in enumerate(found):
        for j, old in enumerate(lost):
            pairs = [
                (a, b)
                for a in new.by_camera
                for b in old.by_camera
                if a == b or not new.by_camera.keys() & old.by_camera.keys()
            ]
            fits = [
                (new.by_camera[a], old.by_camera[b])
                for a, b in pairs
                if new.by_camera[a].histogram_sum.size == old.by_camera[b].histogram_sum.size
            ]
            assert np.isnan(distance[i, j]) == (not fits)
            if any(a is not None and np.array_equal(a.mean, b.mean) for a, b in fits) and len(fits) == 1:
                assert distance[i, j] == pytest.approx(0.0)


def test_an_incomparable_histogram_counts_as_none() -> None:
    appearance = PersonAppearance()
    for histogram in (np.zeros(0), np.zeros(BINS), np.full(BINS, np.nan), np.full(BINS, -1.0)):
        appearance.add("c0", MeanHistogram.of(histogram, 5))
    assert appearance.by_camera == {}
    distances = appearance_distances(HistogramEqualizer(), [appearance], [appearance])
    assert match_by_appearance(distances, np.ones((1, 1), dtype=np.bool_), 1.0) == [-1]


DISTANCES = st.lists(st.floats(0, 1), max_size=8).map(lambda values: np.array(values, dtype=np.float64))


@settings(deadline=None, max_examples=200)
@given(DISTANCES, DISTANCES, st.floats(0, 1), st.floats(0, 1), st.integers(0, 20), st.integers(0, 20))
def test_appearance_evidence_falls_with_distance_within_its_cap(
    same_person: np.ndarray, different_people: np.ndarray, one: float, two: float, frames: int, more: int
) -> None:
    weights, scale = (
        AppearanceWeights(typical=3.0, maximum=4.0, full_weight_frames=8),
        DistanceScale.learned(same_person, different_people),
    )
    assert 0.0 <= scale.same_person <= scale.different_people_quartile

    def evidence(distance: float, count: int) -> float:
        counts = np.array([float(count)])
        return float(appearance_evidence(np.array([distance]), counts, np.array([8.0]), scale, weights)[0])

    near, far = sorted((one, two))
    assert evidence(near, frames) >= evidence(far, frames)
    assert abs(evidence(one, frames + more)) >= abs(evidence(one, frames)), "more frames have more weight"
    assert abs(evidence(one, frames)) <= weights.maximum * min(frames / weights.full_weight_frames, 1.0)
    if scale.different_people_quartile > 1e-6:
        assert evidence(scale.same_person, 8) == pytest.approx(weights.typical)
        assert evidence(scale.different_people_quartile, 8) == pytest.approx(-weights.typical)
