"""Foot points map to the ground point of the person, and back."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import (
    camera_height,
    foot_covariance,
    foot_points,
    ground_handedness,
    horizon_row,
    person_heights,
    shows_ground,
    to_ground,
    validate_homography,
)
from bestview.geometry.ground_plane import feet_cut_off, from_ground, upright_from_overhead


def looking_along(height: float = 3.0, focal: float = 400.0) -> NDArray[np.float64]:
    """Return the homography of a level camera over (0, 0), looking along +Y: 640x480, meters."""
    ground_to_image = np.array([[focal, 320.0, 0.0], [0.0, 240.0, focal * height], [0.0, 1.0, 0.0]])
    return np.linalg.inv(ground_to_image)


@settings(deadline=None, max_examples=60)
@given(st.floats(-20, 20), st.floats(1, 50))
def test_projection_to_the_picture_and_back_is_the_identity(x: float, y: float) -> None:
    pixel = np.array([320 + 400 * x / y, 240 + 400 * 3 / y])
    assert to_ground(looking_along(), pixel) == pytest.approx([x, y], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("scale", [1.0, -2.5])
def test_points_on_or_above_the_horizon_have_no_ground_point(scale: float) -> None:
    points = np.array([[320, 239], [320, 240], [np.nan, 300], [320, 300]], float)
    ground = to_ground(scale * looking_along(), points)
    assert np.isnan(ground[:3]).all()
    assert np.isfinite(ground[3]).all()


@pytest.mark.parametrize("scale", [1.0, -2.5])
def test_the_horizon_is_where_the_ground_ends(scale: float) -> None:
    assert horizon_row(scale * looking_along(), 320.0) == pytest.approx(240.0)
    tilted = looking_along() @ np.array([[1.0, 0.0, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, 1.0]])
    for x in (0.0, 320.0, 640.0):
        row = horizon_row(tilted, x)
        assert row == pytest.approx(240.0 - 0.1 * x)
        above, below = to_ground(tilted, np.array([[x, row - 1.0], [x, row + 1.0]]))
        assert np.isnan(above).all()
        assert np.isfinite(below).all()
    assert horizon_row(np.diag([0.02, 0.02, 1.0]), 0.0) is None


@settings(deadline=None, max_examples=60)
@given(
    st.floats(0.05, 3.0),
    st.floats(-3.1, 3.1),
    st.sampled_from([1.0, -1.0]),
    st.sampled_from([1.0, -2.5]),
)
def test_a_camera_tilted_past_straight_down_has_the_floor_mirrored_and_shows_none(
    tilt: float, pan: float, mirror: float, scale: float
) -> None:
    straight = np.pi / 2
    assume(abs(tilt - straight) > 0.05)
    # Rows: the picture's x, its y (down) and its depth, of a camera 3 above the floor, 640x480.
    right = np.array([np.cos(pan), -np.sin(pan), 0.0])
    ahead = np.array([np.sin(pan), np.cos(pan), 0.0])
    forward = np.cos(tilt) * ahead - np.sin(tilt) * np.array([0.0, 0.0, 1.0])
    axes = np.stack([right, np.cross(forward, right), forward])
    floor = np.array([[mirror, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -3.0]])
    lens = np.array([[400.0, 0.0, 320.0], [0.0, 400.0, 240.0], [0.0, 0.0, 1.0]])
    homography = scale * np.linalg.inv(lens @ axes @ floor)
    assert ground_handedness(homography) == (-mirror if tilt < straight else mirror)
    horizon_row = 240.0 - 400.0 * np.tan(tilt)
    assert shows_ground(homography, (640, 480)) == (horizon_row < 480.0)


@pytest.mark.parametrize("high", [1.9, 7.5])
def test_camera_height_follows_from_the_horizon(high: float) -> None:
    for x in (100.0, 320.0):
        assert camera_height(looking_along(high), x) == pytest.approx(high)
    assert camera_height(np.diag([0.02, 0.02, 1.0]), 0.0) is None


def test_feet_are_in_the_middle_of_the_lower_edge() -> None:
    assert foot_points(np.array([[10, 20, 30, 80]], float)).tolist() == [[20, 80]]


def test_person_height_on_the_ground_matches_the_picture() -> None:
    y, tall = 8.0, 1.75
    foot = 240 + 400 * 3 / y
    box = np.array([[400.0, foot - 400 * tall / y, 440.0, foot]])
    assert person_heights(looking_along(), box) == pytest.approx([tall])


def test_distance_is_less_certain_than_direction() -> None:
    near, far = (np.array([310.0, 240 + 1200 / y - 700 / y, 330.0, 240 + 1200 / y]) for y in (5.0, 10.0))
    spreads = foot_covariance(looking_along(), np.array([near, far]), sideways=0.05, upwards=0.05)
    across, along = np.sqrt(spreads[:, 0, 0]), np.sqrt(spreads[:, 1, 1])
    assert across == pytest.approx([0.05 * 1.75] * 2)  # a share of the person's height, near or far
    assert (along > across).all()
    assert along[1] == pytest.approx(2 * along[0])  # the angle between ray and ground decreases


@pytest.mark.parametrize(
    ("matrix", "match"),
    [
        ([[1, 0], [0, 1]], r"of door has shape \(2, 2\)"),
        ([[1, 0, 0], [0, 1, 0], [0, 0, float("nan")]], "of door has entries that are not finite"),
        ([[1, 2, 3], [2, 4, 6], [0, 0, 1]], "of door is not invertible"),
        ([[0, 0, 0], [0, 0, 0], [0, 0, 0]], "of door is not invertible"),
        ("north", "of door is not a 3x3 matrix"),
        ([[1, 0, 0], [0, 1], [0, 0, 1]], "of door is not a 3x3 matrix"),
    ],
)
def test_an_invalid_homography_is_refused_with_the_cameras_name(matrix: object, match: str) -> None:
    with pytest.raises(ValueError, match=match) as refusal:
        validate_homography(matrix, "door")  # type: ignore[arg-type]
    assert "\n" not in str(refusal.value)


def test_a_homography_in_any_unit_is_accepted() -> None:
    for unit in (1e-3, 1.0, 1e4):
        scaled = np.diag([unit, unit, 1.0]) @ looking_along()
        assert np.array_equal(validate_homography(scaled.tolist(), "door"), scaled)


def test_the_recordings_homographies_are_accepted(shared_data: Path) -> None:
    for scene in ("campus4", "lab4", "pets09", "terrace"):
        ground = json.loads((shared_data / scene / "ground.json").read_text())
        for camera, matrix in ground["homography"].items():
            validate_homography(matrix, camera)


@settings(deadline=None, max_examples=60)
@given(st.floats(-20, 20), st.floats(0.1, 50) | st.floats(-50, -0.1), st.sampled_from([1.0, -2.5]))
def test_ground_points_project_to_the_picture_unless_behind_the_camera(
    x: float, y: float, scale: float
) -> None:
    homography = scale * looking_along()
    pixel = from_ground(homography, np.array([x, y]))
    if y > 0:
        assert to_ground(homography, pixel) == pytest.approx([x, y], rel=1e-6, abs=1e-6)
    else:
        assert np.isnan(pixel).all()
    assert np.isnan(from_ground(homography, np.array([np.nan, y]))).all()


def test_feet_on_the_lower_edge_are_cut_off_and_boxes_beyond_it_are_complete() -> None:
    bottoms = np.array([100.0, 470.0, 476.0, 480.0, 484.0, 490.0, 560.0])
    boxes = np.stack([np.zeros(7), np.zeros(7), np.full(7, 50.0), bottoms], axis=-1)
    assert feet_cut_off(boxes, 480.0).tolist() == [False, False, True, True, True, False, False]
    assert not feet_cut_off(boxes, float("inf")).any()


def test_a_box_from_overhead_has_its_foot_point_in_the_middle() -> None:
    from_above = np.array([[100.0, 200.0, 140.0, 240.0], [np.nan] * 4])
    upright = upright_from_overhead(from_above)
    assert foot_points(upright)[0].tolist() == [120.0, 220.0]
    plan = np.diag([0.02, 0.02, 1.0])  # meters a pixel
    assert 1.5 < person_heights(plan, upright)[0] < 2.0
    assert np.isnan(upright[1]).all()
    assert not feet_cut_off(upright_from_overhead(np.array([[10.0, 440.0, 50.0, 480.0]])), 480.0).any()


def test_an_inverted_overhead_box_has_height_zero() -> None:
    inverted = np.array([[140.0, 200.0, 100.0, 240.0]])  # warnings are errors in tests
    assert upright_from_overhead(inverted).tolist() == [[140.0, 220.0, 100.0, 220.0]]
