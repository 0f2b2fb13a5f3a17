"""What cameras get wrong about places is learned from how they disagree: noise, and offsets that stay."""

from __future__ import annotations

import numpy as np
import pytest

from fakes.tracking.walked_floor import FloorNoise, detect_walkers, floor_views
from tracking.boxes import Floats
from tracking.ground_plane import GroundSettings
from tracking.ground_plane.camera import BoxSizes
from tracking.ground_plane.places.hypotheses import Places, find_places
from tracking.ground_plane.places.measurements import measure
from tracking.ground_plane.places.place_errors import PlaceErrors

VIEWS = floor_views()
CAMERAS = [view.camera for view in VIEWS.values()]
SETTINGS = GroundSettings()
NOWHERE = np.zeros((3, 2))


def places_in(errors: PlaceErrors, seed: int, noise: FloorNoise, true_offsets: Floats) -> Places:
    """Return the places of three people as cameras see them whose calibrations err, less what is known."""
    people = np.random.default_rng(seed).uniform(2.0, 8.0, (1, 3, 2))
    found = detect_walkers(people, VIEWS, noise, seed)[0]
    cameras = [
        camera.shifted(wrong - known)
        for camera, wrong, known in zip(CAMERAS, true_offsets, errors.offsets, strict=True)
    ]
    measurements = measure(cameras, list(found.values()), errors.noise, SETTINGS)
    return find_places(measurements, [], cameras, [BoxSizes()] * 3, SETTINGS, 1.0)


def likeliest(places: Places) -> list[int]:
    """Return the places that exclude each other least, the likeliest first."""
    free, chosen = np.ones(len(places), dtype=bool), []
    for k in np.argsort(places.costs):
        if free[k]:
            chosen.append(int(k))
            free &= ~places.conflicts[k]
    return chosen


def learned(noise: FloorNoise, true_offsets: Floats = NOWHERE, frames: int = 60) -> PlaceErrors:
    errors = PlaceErrors(3)
    for seed in range(frames):
        places = places_in(errors, seed, noise, true_offsets)
        errors.update(places, likeliest(places))
    return errors


@pytest.mark.parametrize(("deviation", "low", "high"), [(0.002, 1.0, 1.2), (0.04, 1.5, 2.5)])
def test_the_noise_of_the_places_is_learned(deviation: float, low: float, high: float) -> None:
    assert PlaceErrors(3).noise.min() > 2.0, "wide, as long as nothing is known"
    assert low <= learned(FloorNoise(deviation=deviation)).noise.mean() < high


def test_by_how_much_cameras_disagree_is_learned() -> None:
    wrong = np.array([[0.5, 0.1], [-0.3, 0.0], [0.0, -0.2]])
    found = learned(FloorNoise(deviation=0.01), wrong, frames=200).offsets
    assert np.abs(found - found.mean(axis=0) - (wrong - wrong.mean(axis=0))).max() < 0.08


def test_cameras_that_agree_are_left_where_they_are() -> None:
    assert np.abs(learned(FloorNoise(deviation=0.01)).offsets).max() < 0.05


def test_what_all_cameras_have_in_common_does_not_show() -> None:
    common = np.tile([0.4, -0.3], (3, 1))
    assert np.abs(learned(FloorNoise(deviation=0.01), common).offsets).max() < 0.05


def test_one_camera_alone_teaches_nothing() -> None:
    errors = PlaceErrors(3)
    places = places_in(errors, 0, FloorNoise(), NOWHERE)
    alone = [k for k in range(len(places)) if len(places.locating(k)) == 1]
    noise = errors.noise.copy()
    errors.update(places, alone)
    assert not errors.offsets.any()
    assert (errors.noise == noise).all()


def test_an_offset_has_an_end() -> None:
    errors = PlaceErrors(3)
    for seed in range(400):
        # What is learned is never taken out, as if cameras went on to drift apart.
        places = places_in(PlaceErrors(3), seed, FloorNoise(), np.array([[0.5, 0.0], [0.0, 0.0], [0.0, 0.0]]))
        errors.update(places, likeliest(places))
    assert 0.9 < np.linalg.norm(errors.offsets, axis=1).max() <= 1.0


def test_a_shifted_camera_maps_there_and_back() -> None:
    camera = CAMERAS[0].shifted(np.array([0.7, -0.2]))
    points = np.array([[100.0, 300.0], [400.0, 460.0]])
    assert camera.to_ground(points) == pytest.approx(CAMERAS[0].to_ground(points) + np.array([0.7, -0.2]))
    assert camera.to_image(camera.to_ground(points)) == pytest.approx(points)
