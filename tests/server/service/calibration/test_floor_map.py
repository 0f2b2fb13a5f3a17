"""A camera covers the floor in its picture, up to some distance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview.geometry.ground_plane import from_ground, to_ground
from server.media.letterbox import Letterbox
from server.service.calibration.floor_map import FARTHEST_RATIO, floor_coverage

SITE = (640, 360)
OWN = (320, 240)
Floats = NDArray[np.float64]


def camera(tilt: float, height: float, focal: float = 200.0) -> Floats:
    """Return the homography of a camera so high above the floor that looks down by `tilt` radians."""
    # A place (X, Y) of the floor in the camera's axes: right, down, forward.
    sin, cos = np.sin(tilt), np.cos(tilt)
    place = np.array([[1.0, 0.0, 0.0], [0.0, -sin, height * cos], [0.0, cos, height * sin]])
    pixels = np.array([[focal, 0.0, OWN[0] / 2], [0.0, focal, OWN[1] / 2], [0.0, 0.0, 1.0]])
    return np.asarray(np.linalg.inv(pixels @ place))


@settings(deadline=None, max_examples=80)
@given(
    tilt=st.floats(-0.2, 1.2),
    height=st.floats(1.0, 9.0),
    sign=st.sampled_from([1.0, -1.0]),
    x=st.floats(0.0, 320.0),
    y=st.floats(0.0, 240.0),
)
def test_a_floor_point_is_covered_if_it_is_in_the_picture_and_not_too_far(
    tilt: float, height: float, sign: float, x: float, y: float
) -> None:
    own = camera(tilt, height) * sign
    part = floor_coverage(own, OWN, SITE)
    on_floor = to_ground(own, np.array([x, y]))
    site = np.append(Letterbox(OWN, SITE).camera_to_site(np.array([x, y])), 1.0)
    mapped = part.site_homography @ site
    assert (mapped[2] > 0) == bool(np.isfinite(on_floor).all())
    if mapped[2] <= 0:
        return
    np.testing.assert_allclose(mapped[:2] / mapped[2], on_floor, rtol=1e-6, atol=1e-9)
    nearest = max(
        (part.site_homography @ np.append(Letterbox(OWN, SITE).camera_to_site(np.array(edge)), 1.0))[2]
        for edge in EDGES
    )
    reach = mapped[2] / nearest * FARTHEST_RATIO
    if abs(reach - 1) > 1e-3 and 1 < x < 319 and 1 < y < 239:
        assert inside(part.outline, on_floor) == (reach > 1)


EDGES = ([0.0, 240.0], [320.0, 240.0], [0.0, 0.0], [320.0, 0.0])


def inside(polygon: Floats, point: Floats) -> bool:
    """Return whether a polygon holds a point: a ray crosses its edges an odd number of times."""
    odd = False
    for one, two in zip(polygon, np.roll(polygon, 1, axis=0), strict=True):
        if (one[1] > point[1]) != (two[1] > point[1]):
            cross = one[0] + (point[1] - one[1]) / (two[1] - one[1]) * (two[0] - one[0])
            odd ^= bool(cross > point[0])
    return odd


def test_the_outline_lies_in_the_picture() -> None:
    own = camera(0.3, 3.0)
    outline = floor_coverage(own, OWN, SITE).outline
    assert len(outline) >= 4
    pixels = from_ground(own, outline)
    assert (pixels >= -1e-6).all()
    assert (pixels <= np.array(OWN) + 1e-6).all()


@pytest.mark.parametrize("tilt", [-0.8, -1.2])
def test_a_camera_that_looks_up_covers_no_floor(tilt: float) -> None:
    assert floor_coverage(camera(tilt, 3.0), OWN, SITE).outline.shape == (0, 2)


def test_an_overhead_camera_covers_its_whole_picture() -> None:
    plan = np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(
        floor_coverage(plan, OWN, SITE).outline, [[0.0, 24.0], [32.0, 24.0], [32.0, 0.0], [0.0, 0.0]]
    )
