"""Who cannot be told from false detections within a window becomes a person by what came before it."""

from __future__ import annotations

import numpy as np
import pytest

from fakes.tracking.walked_floor import FloorNoise, detect_walkers, floor_views
from tracking import Detections, create_solver
from tracking.boxes import Floats
from tracking.ground_plane import GroundPlaneTracker, GroundSettings, track_ground_plane
from tracking.ground_plane.camera import BoxSizes
from tracking.ground_plane.candidates import Candidates
from tracking.ground_plane.places.hypotheses import Places, find_places
from tracking.ground_plane.places.measurements import measure

VIEWS = floor_views()
CAMERAS = [view.camera for view in VIEWS.values()]
SETTINGS, SECONDS = GroundSettings(), 0.2
HERE, NEARBY, FAR = (4.0, 6.0), (4.1, 6.1), (7.0, 3.0)


def places_of(*people: tuple[float, float]) -> Places:
    """Return the hypotheses of a frame in which all cameras detect these people."""
    found = detect_walkers(np.array([people]), VIEWS, FloorNoise())[0]
    measurements = measure(CAMERAS, list(found.values()), np.ones(len(CAMERAS)), SETTINGS)
    return find_places(measurements, [], CAMERAS, [BoxSizes() for _ in CAMERAS], SETTINGS, SECONDS)


def nearest(places: Places, place: tuple[float, float]) -> int:
    return int(np.linalg.norm(places.means - place, axis=1).argmin())


def discount(candidates: Candidates, place: tuple[float, float]) -> float:
    return float(candidates.discounts(places_of(place), SETTINGS)[0])


def missed(candidates: Candidates, cost: float = 0.0) -> Floats:
    return np.full(len(candidates.places), cost)


def test_evidence_grows_where_somebody_is_found_again_and_nowhere_else() -> None:
    candidates = Candidates(SECONDS)
    assert discount(candidates, HERE) == 0.0
    discounts = []
    for place in (HERE, NEARBY, HERE):
        candidates.update(places_of(place), [], missed(candidates), SETTINGS)
        discounts.append(discount(candidates, HERE))
    assert 0.0 < discounts[0] < discounts[1] < discounts[2]
    assert discount(candidates, FAR) == 0.0
    assert len(candidates.places) == 1


def test_who_stands_still_far_away_becomes_surer_with_each_detection() -> None:
    """Places that are not precise, in one camera, must not cost more than the detections there say."""
    seconds, cameras = SETTINGS.frame_s, CAMERAS[:1]
    found = detect_walkers(np.array([[HERE]]), VIEWS, FloorNoise())[0]
    seen = Detections(found["c0"].boxes, np.array([0.7]), found["c0"].histograms)
    measurements = measure(cameras, [seen], np.array([4.0]), SETTINGS)
    places = find_places(measurements, [], cameras, [BoxSizes()], SETTINGS, seconds)
    candidates, gain = Candidates(seconds), -float(places.costs[0])
    for detections in range(1, 6):
        candidates.update(places, [], missed(candidates), SETTINGS)
        assert float(candidates.discounts(places, SETTINGS)[0]) > 0.8 * detections * gain - gain


def test_two_who_stand_apart_are_two() -> None:
    candidates = Candidates(SECONDS)
    for _ in range(3):
        candidates.update(places_of(HERE, FAR), [], missed(candidates), SETTINGS)
    assert len(candidates.places) == 2
    assert discount(candidates, HERE) > 0.0
    assert discount(candidates, FAR) > 0.0


def test_who_is_missed_loses_evidence_and_is_dropped() -> None:
    candidates = Candidates(SECONDS)
    for _ in range(3):
        candidates.update(places_of(HERE), [], missed(candidates), SETTINGS)
    before = discount(candidates, HERE)
    candidates.update(places_of(FAR), [], missed(candidates, 0.5), SETTINGS)
    assert 0.0 < discount(candidates, HERE) < before - 0.4
    candidates.update(places_of(FAR), [], missed(candidates, 1e3), SETTINGS)
    assert discount(candidates, HERE) == 0.0


def test_nobody_is_a_candidate_for_ever_who_is_not_seen() -> None:
    candidates = Candidates(SECONDS)
    candidates.update(places_of(HERE), [], missed(candidates), SETTINGS)
    for _ in range(6):
        candidates.update(places_of(FAR), [nearest(places_of(FAR), FAR)], missed(candidates), SETTINGS)
    assert len(candidates.places) == 0


def test_whom_the_program_has_found_is_no_candidate() -> None:
    candidates = Candidates(SECONDS)
    for _ in range(3):
        candidates.update(places_of(HERE), [], missed(candidates), SETTINGS)
    found = places_of(HERE, FAR)
    candidates.update(found, [nearest(found, HERE)], missed(candidates), SETTINGS)
    assert discount(candidates, HERE) == 0.0
    assert discount(candidates, FAR) > 0.0


@pytest.mark.parametrize("fps", [25.0, 5.0])
def test_whom_one_camera_alone_detects_with_doubt_is_found_after_a_while(fps: float) -> None:
    frames = round(6.0 * fps)
    walk = np.stack([[[2.0 + 4.0 * frame / frames, 5.0]] for frame in range(frames)])
    doubtful = [
        {"c0": Detections(found["c0"].boxes, np.full(1, 0.3), found["c0"].histograms)}
        for found in detect_walkers(walk, VIEWS, FloorNoise(deviation=0.01))
    ]
    nobody = [{"c0": Detections.empty(0)} for _ in range(round(3.0 * fps))]
    certain = [{"c0": Detections(VIEWS["c0"].box(np.array(FAR))[None], np.ones(1), np.zeros((1, 0)))}]
    # The beginning, in which everybody may have been there, has passed.
    recording = [*certain, *nobody, *doubtful]
    tracker = GroundPlaneTracker({"c0": VIEWS["c0"].camera}, SETTINGS, create_solver("arcs"), fps)
    shown = [len(frame.tracks) for frame in track_ground_plane(tracker, enumerate(recording))]
    assert shown[-3] == 1
