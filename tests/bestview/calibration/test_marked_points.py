"""Calibration from marked points recovers the homography, and names wrong pairs."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import to_ground
from bestview.calibration import (
    CalibrationError,
    Floats,
    MarkedPoints,
    fit_cameras,
    fit_homography,
    fit_points,
)


def camera_over_floor(random: np.random.Generator) -> Floats:
    """Return the homography of a camera that looks down on the floor: 640x360 pixels to meters."""
    focal, tilt, turn = random.uniform(350, 900), random.uniform(0.2, 1.2), random.uniform(0, 6.28)
    forward = np.array([np.cos(turn) * np.cos(tilt), np.sin(turn) * np.cos(tilt), -np.sin(tilt)])
    right = np.cross(forward, (0, 0, 1.0))
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward])
    centre = np.array([*random.uniform(-5, 5, 2), random.uniform(2, 6)])
    lens = np.array([[focal, 0, 320], [0, focal, 180], [0, 0, 1]])
    return np.asarray(np.linalg.inv(lens @ np.column_stack([axes[:, :2], -axes @ centre])))


def marked(random: np.random.Generator, count: int) -> tuple[MarkedPoints, Floats]:
    """Return exact pairs spread over the lower part of the picture, and the homography."""
    homography = camera_over_floor(random)
    corners = np.array([[40, 200], [600, 210], [50, 350], [610, 340]], dtype=float)
    image = np.concatenate([corners, random.uniform((30, 200), (610, 350), (count, 2))])[:count]
    return MarkedPoints("c0", image, to_ground(homography, image)), homography


seeds = st.integers(0, 10_000).map(np.random.default_rng)


@settings(deadline=None, max_examples=15)
@given(seeds, st.integers(4, 12))
def test_exact_pairs_give_the_homography(random: np.random.Generator, count: int) -> None:
    points, truth = marked(random, count)
    fit = fit_points(points)
    probe = np.array([[100.0, 300.0], [500.0, 330.0], [320.0, 250.0]])
    assert np.allclose(to_ground(fit.homography, probe), to_ground(truth, probe), rtol=1e-4, atol=1e-4)
    assert fit.image_error.max() < 1e-3


def test_memory_is_linear_in_the_number_of_pairs() -> None:
    points, truth = marked(np.random.default_rng(0), 50_000)  # a square matrix of that size has 20 gigabytes
    found = fit_homography(points.image, points.floor)
    assert np.allclose(to_ground(found, points.image[:4]), to_ground(truth, points.image[:4]), atol=1e-4)


@settings(deadline=None, max_examples=15)
@given(seeds, st.integers(8, 20))
def test_an_error_of_a_pixel_in_the_clicks_gives_a_fit_error_of_about_a_pixel(
    random: np.random.Generator, count: int
) -> None:
    points, _ = marked(random, count)
    clicked = points.image + random.normal(0, 1.0, points.image.shape)
    fit = fit_points(MarkedPoints("c0", clicked, points.floor))
    assert np.median(fit.image_error) < 2.5


@settings(deadline=None, max_examples=15)
@given(seeds, st.integers(7, 14), st.data())
def test_a_pair_that_contradicts_the_others_is_named(
    random: np.random.Generator, count: int, data: st.DataObject
) -> None:
    points, _ = marked(random, count)
    image = points.image + random.normal(0, 0.5, points.image.shape)
    wrong = data.draw(st.integers(0, count - 1))
    image[wrong] += (0.0, 90.0 if image[wrong, 1] < 260 else -90.0)
    with pytest.raises(CalibrationError, match=re.escape(f"camera c0: pair {wrong + 1} (image")) as refused:
        fit_points(MarkedPoints("c0", image, points.floor))
    assert "contradicts the others" in str(refused.value)


def test_of_five_contradicting_pairs_none_is_named() -> None:
    floor = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [2.0, 2.0]])
    image = floor * 100 + np.array([[0, 0], [0, 0], [0, 0], [0, 0], [120, 60]])
    with pytest.raises(CalibrationError, match=r"the pairs contradict each other.*add more"):
        fit_points(MarkedPoints("c0", image, floor))


@pytest.mark.parametrize("aside", [0, 1])
def test_points_on_a_line_are_refused(aside: int) -> None:
    along = np.linspace(0, 1, 6)[:, None]
    image = np.array([50.0, 300.0]) + along * (500.0, -40.0)
    image[:aside] += (0, 40.0)
    with pytest.raises(CalibrationError, match=r"camera c0: .*on a line; mark some beside it"):
        fit_points(MarkedPoints("c0", image, image * 0.01))


def test_too_few_pairs_are_counted() -> None:
    with pytest.raises(CalibrationError, match="camera c0: 3 pairs; at least 4"):
        fit_points(MarkedPoints("c0", np.eye(3)[:, :2], np.eye(3)[:, :2]))


def test_one_image_point_with_two_floor_points_is_refused() -> None:
    points, _ = marked(np.random.default_rng(1), 6)
    image = points.image.copy()
    image[4] = image[1]
    with pytest.raises(
        CalibrationError, match="pair 2 and pair 5 are one point in the picture and two on the"
    ):
        fit_points(MarkedPoints("c0", image, points.floor))


def test_corners_in_another_order_are_refused() -> None:
    image = np.array([[100.0, 100.0], [500.0, 100.0], [550.0, 300.0], [50.0, 300.0]])
    floor = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0], [4.0, 3.0]])  # the last two exchanged
    with pytest.raises(CalibrationError, match="another order on the floor"):
        fit_points(MarkedPoints("c0", image, floor))


def test_a_camera_with_exchanged_floor_coordinates_is_named() -> None:
    random = np.random.default_rng(5)
    cameras = [MarkedPoints(f"c{number}", *_coordinates(marked(random, 6)[0])) for number in range(3)]
    cameras[1] = MarkedPoints("c1", cameras[1].image, cameras[1].floor[:, ::-1])
    with pytest.raises(CalibrationError, match="camera c1: its floor is mirrored against that of c0"):
        fit_cameras(cameras)


def _coordinates(points: MarkedPoints) -> tuple[Floats, Floats]:
    return points.image, points.floor


@settings(deadline=None, max_examples=20)
@given(seeds)
def test_no_other_homography_fits_noisy_points_better(random: np.random.Generator) -> None:
    points, _ = marked(random, 9)
    noisy = points.image + random.normal(0, 2.0, points.image.shape)
    found = fit_homography(points.floor, noisy)

    def error(matrix: Floats) -> float:
        through = np.column_stack([points.floor, np.ones(9)]) @ matrix.T
        return float(((through[:, :2] / through[:, 2:] - noisy) ** 2).sum())

    least = error(found)
    for _ in range(20):
        assert error(found * (1 + random.normal(0, 1e-4, (3, 3)))) >= least - 1e-9 * (1 + least)


@pytest.mark.parametrize("seed", range(8))
def test_a_camera_straight_above_is_calibrated_whatever_the_errors_of_its_points(seed: int) -> None:
    random = np.random.default_rng(seed)
    image = random.uniform((0, 0), (640, 480), (12, 2))
    points = MarkedPoints("c0", image, image @ np.array([[0.0, 0.01], [0.01, 0.0]]) + 3.0)
    clicked = MarkedPoints("c0", image + random.normal(0, 0.5, image.shape), points.floor)
    fit = fit_points(clicked)
    np.testing.assert_allclose(to_ground(fit.homography, points.image), points.floor, atol=0.02)
    assert fit.image_error.max() < 3
