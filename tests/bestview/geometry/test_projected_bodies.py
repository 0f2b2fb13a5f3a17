"""Bodies estimated from one camera's boxes are projected into all cameras by their homographies."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import BodyEstimates, estimate_bodies, project_boxes, project_feet
from bestview.calibration.pinhole import Pinhole
from fakes.bestview.walkers import SIZE, camera_at

EAST, SOUTH = camera_at(4.0, 0.0), camera_at(0.0, -3.0)
CAMERAS = (EAST, SOUTH)
GROUNDS = np.array([camera.floor_homography() for camera in CAMERAS])
BOTTOM = np.array([SIZE[1], SIZE[1]], dtype=float)


def box_in(camera: Pinhole, place: np.ndarray, aspect_ratio: float = 0.4) -> np.ndarray:
    """Return the box of a person one unit tall at a place, (2,) person heights."""
    x, y = camera.picture(place)
    tall = float(camera.heights(np.array([x, y])))
    return np.array([x - aspect_ratio * tall / 2, y - tall, x + aspect_ratio * tall / 2, y])


def boxes_in_all_cameras(body: BodyEstimates, grounds: np.ndarray) -> np.ndarray:
    """Return the boxes of one body in all cameras, (C, 4)."""
    foot, body_index = project_feet(body, grounds)[0], np.zeros(len(grounds), int)
    return project_boxes(body, body_index, foot, grounds)


@settings(deadline=None, max_examples=60)
@given(st.floats(-1.2, 1.2), st.floats(-0.8, 0.8), st.integers(0, 1))
def test_a_body_is_projected_into_its_own_and_the_other_camera(
    east: float, north: float, camera: int
) -> None:
    place = np.array([east, north])
    own, other = (box_in(view, place) for view in (CAMERAS[camera], CAMERAS[1 - camera]))
    body = estimate_bodies(own[None], np.array([camera]), np.array([0]), 1, GROUNDS, BOTTOM)
    assert body.ground_point[0] == pytest.approx(place, abs=1e-6)
    assert body.known_by[0].tolist() == [camera == 0, camera == 1]
    boxes = boxes_in_all_cameras(body, GROUNDS)
    assert boxes[camera] == pytest.approx(own, abs=1e-6)
    foot = (boxes[1 - camera][0] + boxes[1 - camera][2]) / 2, boxes[1 - camera][3]
    assert foot == pytest.approx(((other[0] + other[2]) / 2, other[3]), abs=1e-6)
    # One pixel to the side is not quite as long as one upwards where a camera looks down.
    assert boxes[1 - camera][3] - boxes[1 - camera][1] == pytest.approx(other[3] - other[1], rel=0.15)


def test_the_nearer_camera_has_more_weight() -> None:
    near, far = camera_at(2.5, 0.0), camera_at(-9.0, 0.0)
    grounds = np.array([camera.floor_homography() for camera in (near, far)])
    boxes = np.array([box_in(near, np.array([0.0, 0.0])), box_in(far, np.array([0.5, 0.0]))])
    body = estimate_bodies(boxes, np.array([0, 1]), np.array([0, 0]), 1, grounds, BOTTOM)
    assert 0.0 < body.ground_point[0, 0] < 0.1
    assert body.known_by.tolist() == [[True, True]]


def test_truncated_feet_and_empty_boxes_have_no_position() -> None:
    cut = np.array([300.0, 200.0, 340.0, 359.5])
    empty = np.array([300.0, 200.0, 300.0, 200.0])
    above = np.array([300.0, -90.0, 340.0, -10.0])
    moments = np.arange(3)
    body = estimate_bodies(np.array([cut, empty, above]), np.zeros(3, int), moments, 4, GROUNDS, BOTTOM)
    assert np.isnan(body.ground_point).all()
    assert not body.known_by.any()
    assert np.isnan(project_feet(body, GROUNDS)).all()


def test_points_behind_a_camera_are_not_projected() -> None:
    place = np.array([0.0, 0.0])
    away = camera_at(1.0, 0.0, towards=(5.0, 0.0))
    grounds = np.array([SOUTH.floor_homography(), away.floor_homography()])
    body = estimate_bodies(box_in(SOUTH, place)[None], np.array([0]), np.array([0]), 1, grounds, BOTTOM)
    boxes = boxes_in_all_cameras(body, grounds)
    assert np.isfinite(boxes[0]).all()
    assert np.isnan(boxes[1]).all()


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_means_equal_those_computed_one_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places = rng.uniform(-0.8, 0.8, (20, 2))
    camera, moment = rng.integers(0, 2, 20), rng.integers(0, 6, 20)
    boxes = np.array([box_in(CAMERAS[c], place) for c, place in zip(camera, places, strict=True)])
    together = estimate_bodies(boxes, camera, moment, 6, GROUNDS, BOTTOM)
    for one in range(6):
        rows = moment == one
        alone = estimate_bodies(boxes[rows], camera[rows], np.zeros(rows.sum(), int), 1, GROUNDS, BOTTOM)
        for value, expected in zip(
            (together.ground_point[one], together.height[one], together.known_by[one]),
            (alone.ground_point[0], alone.height[0], alone.known_by[0]),
            strict=True,
        ):
            assert np.array_equal(value, expected, equal_nan=True), "bit for bit, independent of other bodies"
        if rows.any():
            low, high = places[rows].min(axis=0), places[rows].max(axis=0)
            assert (
                (together.ground_point[one] >= low - 1e-6) & (together.ground_point[one] <= high + 1e-6)
            ).all()
