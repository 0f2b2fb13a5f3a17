"""A detection with its feet in the wrong place is still of the person whose head and sides it shows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fakes.tracking.walked_floor import FloorNoise, detect_walkers, floor_views
from tracking import Detections
from tracking.boxes import Floats, heights
from tracking.ground_plane import GroundSettings
from tracking.ground_plane.camera import BoxSizes
from tracking.ground_plane.places.hypotheses import Places, find_places
from tracking.ground_plane.places.measurements import measure

VIEWS = floor_views()
CAMERAS = [view.camera for view in VIEWS.values()]
SETTINGS = GroundSettings()
PLACE = [5.0, 5.0]


def known_sizes() -> list[BoxSizes]:
    sizes = [BoxSizes() for _ in CAMERAS]
    random = np.random.default_rng(0)
    for frame in detect_walkers(random.uniform(1.0, 9.0, (20, 4, 2)), VIEWS, FloorNoise()):
        for size, found in zip(sizes, frame.values(), strict=True):
            size.update(found.boxes)
    return sizes


def places_with(change: Callable[[Floats], None]) -> Places:
    """Return the places of one person whose box in the first camera is changed, the likeliest first."""
    found = list(detect_walkers(np.array([[PLACE]]), VIEWS, FloorNoise(), 0)[0].values())
    boxes = found[0].boxes.copy()
    change(boxes)
    found[0] = Detections(boxes, found[0].scores, found[0].histograms)
    return find_places(
        measure(CAMERAS, found, np.ones(len(CAMERAS)), SETTINGS), [], CAMERAS, known_sizes(), SETTINGS, 1.0
    )


def cut_feet(boxes: Floats) -> None:
    boxes[:, 3] -= 0.2 * heights(boxes)


def move_aside(boxes: Floats) -> None:
    boxes[:, [0, 2]] += 0.5 * heights(boxes)[:, None]


def test_feet_that_are_hidden_do_not_make_another_person() -> None:
    places = places_with(cut_feet)
    best = int(places.costs.argmin())
    assert len(places.groups[best]) == len(CAMERAS), "all cameras' detections are of one person"
    assert places.misplaced[best].sum() == 1
    assert places.measurements.camera[places.misplaced[best]].tolist() == [0]
    assert places.means[best] == pytest.approx(PLACE, abs=0.3), "located by the other cameras"
    assert len(places.locating(best)) == len(CAMERAS) - 1


def test_the_place_without_it_stays_a_hypothesis() -> None:
    places = places_with(cut_feet)
    best = int(places.costs.argmin())
    without = [k for k, group in enumerate(places.groups) if list(group) == places.locating(best)]
    assert len(without) == 1
    assert places.costs[without[0]] > places.costs[best]
    assert places.conflicts[best, without[0]]


def test_a_box_beside_the_person_is_somebody_elses() -> None:
    places = places_with(move_aside)
    best = int(places.costs.argmin())
    assert not places.misplaced[best].any()
    assert 0 not in places.measurements.camera[list(places.groups[best])]


@pytest.mark.parametrize("probability", [0.0, 1.0])
def test_the_probability_is_between_0_and_1(probability: float) -> None:
    with pytest.raises(ValueError, match="misplaced_probability"):
        GroundSettings(misplaced_probability=probability)
