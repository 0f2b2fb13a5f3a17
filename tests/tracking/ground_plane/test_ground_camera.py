"""Cameras over a plane: projections there and back, and the sizes of people."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.walked_floor import FloorNoise, detect_walkers, floor_views
from tracking.boxes import heights
from tracking.ground_plane import GroundCamera
from tracking.ground_plane.camera import BoxSizes, feet
from tracking.ground_plane.places.measurements import estimate_units_per_meter
from tracking.ground_plane.places.visibility import in_picture

VIEWS = floor_views()
CAMERA = VIEWS["c0"].camera
coordinate = st.floats(0.0, 10.0)
many = settings(deadline=None, max_examples=50)


@many
@given(coordinate, coordinate)
def test_places_are_projected_there_and_back(x: float, y: float) -> None:
    for view in VIEWS.values():
        point = view.camera.to_image(np.array([[x, y]]))
        assert view.camera.to_ground(point)[0] == pytest.approx([x, y], abs=1e-6)
        assert point[0] == pytest.approx(feet(view.box(np.array([x, y]))[None])[0], abs=1e-6)


@many
@given(coordinate, coordinate)
def test_jacobians_are_derivatives(x: float, y: float) -> None:
    point = CAMERA.to_image(np.array([[x, y]]))
    steps = 1e-4 * np.eye(2)
    differences = (CAMERA.to_ground(point + steps) - CAMERA.to_ground(point - steps)) / 2e-4
    assert CAMERA.jacobians(point)[0] == pytest.approx(differences.T, rel=1e-3, abs=1e-6)


def test_a_turned_camera_sees_what_has_come_into_its_picture() -> None:
    """Its picture has moved to the right by half of its width."""
    moved = np.array([[1.0, 0.0, CAMERA.width / 2], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    camera = replace(CAMERA, turned=moved)
    across, down = np.array([0.25, 0.75, -0.25]) * CAMERA.width, np.full(3, CAMERA.height / 2)
    points = np.stack([across, down], axis=1)
    boxes = np.stack([across - 20.0, down - 90.0, across + 20.0, down], axis=1)
    for one, shown in ((CAMERA, [True, True, False]), (camera, [True, False, True])):
        assert one.contains(points).tolist() == in_picture(boxes, one).tolist() == shown
    assert camera.to_ground(points) == pytest.approx(CAMERA.to_ground(points)), "places are those of before"
    assert camera.scaled(2.0).shifted(np.ones(2)).turned is moved


def test_places_behind_the_camera_have_no_image() -> None:
    assert np.isnan(CAMERA.to_image(np.array([[-20.0, -20.0]]))).all()


@pytest.mark.parametrize("homography", [np.zeros((3, 3)), np.full((3, 3), np.nan), np.eye(2)])
def test_homographies_that_are_none_are_refused(homography: np.ndarray) -> None:
    with pytest.raises(ValueError, match="homography"):
        GroundCamera(homography, 640.0, 480.0)


def test_the_height_of_people_is_learned_from_boxes() -> None:
    walks = np.random.default_rng(0).uniform(1.0, 9.0, (30, 3, 2))
    sizes = BoxSizes()
    for frame in detect_walkers(walks, VIEWS, FloorNoise(deviation=0.01)):
        sizes.update(frame["c0"].boxes)
    assert sizes.known
    true = np.array([VIEWS["c0"].box(place) for place in walks.reshape(-1, 2)])
    assert heights(sizes.boxes(feet(true))) == pytest.approx(heights(true), rel=0.1)


def test_a_meter_is_found_from_the_heights_of_people() -> None:
    frame = detect_walkers(np.random.default_rng(0).uniform(1.0, 9.0, (1, 12, 2)), VIEWS, FloorNoise())[0]
    boxes = {index: found.boxes for index, found in enumerate(frame.values())}
    cameras = [view.camera for view in VIEWS.values()]
    assert estimate_units_per_meter(cameras, boxes) == pytest.approx(1.0, rel=0.25)
    assert estimate_units_per_meter([camera.scaled(0.01) for camera in cameras], boxes) == pytest.approx(
        100.0, rel=0.25
    )
    assert estimate_units_per_meter(cameras, {}) is None
