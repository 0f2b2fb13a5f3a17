"""Letterboxing of a camera's picture in the site's, and coordinates both ways."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.media.letterbox import Letterbox

sides = st.integers(16, 4000)
sizes = st.tuples(sides, sides)
places = st.lists(st.tuples(*[st.floats(-5000, 5000)] * 4), min_size=1, max_size=5)


@given(sizes, sizes, places)
def test_boxes_are_the_same_after_mapping_to_the_site_and_back(
    own: tuple[int, int], site: tuple[int, int], boxes: list[tuple[float, float, float, float]]
) -> None:
    letterbox, own_boxes = Letterbox(own, site), np.array(boxes)
    np.testing.assert_allclose(
        letterbox.boxes_site_to_camera(letterbox.boxes_camera_to_site(own_boxes)), own_boxes, atol=1e-6
    )


@given(sizes, sizes)
def test_the_whole_picture_is_visible_undistorted_and_touches_two_sides(
    own: tuple[int, int], site: tuple[int, int]
) -> None:
    left, top, right, bottom = Letterbox(own, site).boxes_camera_to_site(np.array([[0.0, 0.0, *own]]))[0]
    assert (right - left) / own[0] == pytest.approx((bottom - top) / own[1])
    assert min(left, top) >= 0
    assert right <= site[0] + 1e-6
    assert bottom <= site[1] + 1e-6
    assert max((right - left) / site[0], (bottom - top) / site[1]) == pytest.approx(1.0)


def test_a_picture_of_the_sites_size_is_unchanged() -> None:
    picture = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    assert Letterbox((64, 48), (64, 48)).image(picture) is picture


@pytest.mark.parametrize(
    ("own", "bars"),
    [((64, 64), (slice(None), slice(0, 8))), ((128, 48), (slice(0, 12), slice(None)))],
)
def test_the_bars_are_black_and_the_rest_is_the_picture(
    own: tuple[int, int], bars: tuple[slice, slice]
) -> None:
    white = np.full((own[1], own[0], 3), 255, dtype=np.uint8)
    fitted = Letterbox(own, (64, 48)).image(white)
    assert fitted.shape == (48, 64, 3)
    assert (fitted[bars] == 0).all()
    assert (fitted[24, 32] == 255).all()
    assert 0.3 < fitted.mean() / 255 < 0.8


def test_pixels_are_where_their_mapped_coordinates_are() -> None:
    picture = np.zeros((100, 50, 3), dtype=np.uint8)
    picture[60:80, 10:30] = 255
    letterbox = Letterbox((50, 100), (200, 200))
    left, top, right, bottom = letterbox.boxes_camera_to_site(np.array([[10.0, 60.0, 30.0, 80.0]]))[0]
    fitted = letterbox.image(picture)
    rows, columns = np.nonzero(fitted[:, :, 0] > 127)
    assert (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1) == (left, top, right, bottom)
    np.testing.assert_array_equal(letterbox.camera_to_site(np.array([[10.0, 60.0]])), [[left, top]])


def test_a_picture_of_an_unexpected_size_is_scaled_to_the_site() -> None:
    letterbox = Letterbox((64, 48), (64, 48))
    assert letterbox.image(np.zeros((100, 100, 3), np.uint8)).shape == (48, 64, 3)
