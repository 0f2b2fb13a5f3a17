"""Travel times between cameras are learned from certain re-identifications and become evidence."""

from __future__ import annotations

from itertools import pairwise
from math import log

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import IdentitySettings
from bestview.association.affinity.travel_times import CameraSighting, TravelTimeModel, travel_time_bins

CAMERAS = ("c0", "c1", "c2")
SETTINGS = IdentitySettings(
    maximum_travel_s=40.0, travel_half_weight_count=5.0, maximum_travel_evidence=4.0
).resolve(25.0)
TRANSITIONS = st.tuples(st.sampled_from(CAMERAS), st.sampled_from(CAMERAS), st.integers(-50, 1500))


def reference_evidence(transitions: list[tuple[str, str, int]], lost: str, found: str, frames: int) -> float:
    """Compute the evidence from the list of all transitions."""
    edges = travel_time_bins(SETTINGS.maximum_travel_frames).tolist()

    def bin_of(time: int) -> int:
        return next((i for i, (low, high) in enumerate(pairwise(edges)) if low <= time < high), -1)

    departures = [(b, bin_of(time)) for a, b, time in transitions if a == lost and bin_of(time) >= 0]
    bin_index, last = bin_of(frames), len(edges) - 2
    if bin_index < 0 or not departures:
        return 0.0
    bins = [place for b, place in departures if b == found]
    weight_in_bin = sum(
        share
        for place in bins
        for offset, share in ((-1, 0.25), (0, 0.5), (1, 0.25))
        if min(max(place + offset, 0), last) == bin_index
    )
    share_of_camera = (len(bins) + 1 / len(CAMERAS)) / (len(departures) + 1)
    share_of_time = (edges[bin_index + 1] - edges[bin_index]) / (edges[-1] - edges[0])
    density = (weight_in_bin / share_of_time + 1) / (len(bins) + 1)
    evidence = min(max(log(len(CAMERAS) * share_of_camera * density), -4.0), 4.0)
    return len(departures) / (len(departures) + 5.0) * evidence


@settings(deadline=None, max_examples=200)
@given(st.lists(TRANSITIONS, max_size=30), TRANSITIONS)
def test_travel_evidence_equals_the_reference(
    transitions: list[tuple[str, str, int]], query: tuple[str, str, int]
) -> None:
    travel = TravelTimeModel(SETTINGS, len(CAMERAS))
    for lost, found, frames in transitions:
        travel.learn(CameraSighting(lost, 100), CameraSighting(found, 100 + frames))
    lost, found, frames = query
    evidence = travel.evidence([CameraSighting(found, 70 + frames)], [CameraSighting(lost, 70)])
    assert evidence.shape == (1, 1)
    assert evidence[0, 0] == pytest.approx(reference_evidence(transitions, lost, found, frames))


def test_usual_travel_times_raise_the_evidence_and_unusual_ones_lower_it() -> None:
    travel = TravelTimeModel(SETTINGS, len(CAMERAS))
    for i in range(20):
        travel.learn(CameraSighting("c0", 0), CameraSighting("c1", 150 + i))
    found = [
        CameraSighting("c1", 160),
        CameraSighting("c1", 5),
        CameraSighting("c1", 900),
        CameraSighting("c2", 160),
        CameraSighting("c1", 5000),
    ]
    usual, soon, late, elsewhere, too_late = travel.evidence(found, [CameraSighting("c0", 0)])[:, 0].tolist()
    assert usual > 1.0
    assert max(soon, late, elsewhere) < -1.0
    assert too_late == 0.0, "away for longer than any transition"
    assert not travel.evidence(found, [CameraSighting("c2", 0)]).any(), "no transition from there is known"


def test_old_transitions_fade_and_memory_is_bounded() -> None:
    travel = TravelTimeModel(SETTINGS, len(CAMERAS))
    for i in range(300):
        travel.learn(CameraSighting("c0", i), CameraSighting("c1", i + 30))
    for i in range(150):
        travel.learn(CameraSighting("c0", i), CameraSighting("c1", i + 700))
    old, new = travel.evidence(
        [CameraSighting("c1", 30), CameraSighting("c1", 700)], [CameraSighting("c0", 0)]
    )[:, 0]
    assert new > old
    assert sum(times.sum() for times in travel._departures["c0"].arrivals.values()) <= 64


@given(st.integers(0, 10_000))
def test_time_bins_cover_all_times_without_gaps(longest: int) -> None:
    edges = travel_time_bins(longest)
    assert edges[0] == 1.0
    assert edges[-1] == longest + 1 or longest < 1
    assert (np.diff(edges) > 0).all() or longest < 1


def test_minimal_settings_work() -> None:
    travel = TravelTimeModel(
        IdentitySettings(
            maximum_travel_s=0.0, travel_half_weight_count=0.0, maximum_travel_evidence=0.0
        ).resolve(25.0),
        0,
    )
    travel.learn(CameraSighting("c0", 0), CameraSighting("c1", 1))
    assert travel.evidence([CameraSighting("c1", 1)], [CameraSighting("c0", 0)]).tolist() == [[0.0]]
    assert travel.evidence([], []).shape == (0, 0)
