"""Cameras overlap where people on the floor are seen by two of them, whatever the unit of the floor is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from bestview import FloorView, overlapping_cameras, to_ground
from fakes.tracking.walked_floor import floor_views

Floats = NDArray[np.float64]

SIZE = (640.0, 480.0)
CAMERAS = {name: view.camera.homography for name, view in floor_views().items()}


def overlapping(homographies: Mapping[str, Floats]) -> frozenset[str]:
    return overlapping_cameras({name: FloorView.of(matrix, SIZE) for name, matrix in homographies.items()})


def shift(x: float, y: float) -> Floats:
    """Return how the floor is moved, (3, 3)."""
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("unit", [0.01, 1.0, 100.0])
def test_cameras_around_a_floor_overlap_in_any_unit(unit: float) -> None:
    scale = np.diag([unit, unit, 1.0])
    assert overlapping({name: scale @ matrix for name, matrix in CAMERAS.items()}) == CAMERAS.keys()


def test_a_camera_of_another_room_is_left_alone() -> None:
    assert overlapping(CAMERAS | {"far": shift(100.0, 0.0) @ CAMERAS["c0"]}) == CAMERAS.keys()


def test_cameras_back_to_back_see_nothing_together() -> None:
    camera = CAMERAS["c0"]
    behind = to_ground(camera, np.array([[SIZE[0] / 2.0, 1e7]]))[0]
    turned = shift(*behind) @ np.diag([-1.0, -1.0, 1.0]) @ shift(*-behind)
    assert overlapping({"c0": camera, "back": turned @ camera}) == frozenset()


def test_an_overview_and_a_camera_that_shows_a_part_of_it_large_overlap() -> None:
    cut = np.array([[0.2, 0.0, 0.4 * SIZE[0]], [0.0, 0.2, 0.5 * SIZE[1]], [0.0, 0.0, 1.0]])
    assert overlapping({"all": CAMERAS["c0"], "close": CAMERAS["c0"] @ cut}) == {"all", "close"}


def test_a_camera_that_shows_no_floor_overlaps_with_none() -> None:
    upwards = np.diag([1.0, 1.0, -1.0]) @ CAMERAS["c0"] @ shift(0.0, -1e5)
    assert not len(FloorView.of(upwards, SIZE).places)
    assert overlapping(CAMERAS | {"up": upwards}) == CAMERAS.keys()


def test_one_camera_has_none_to_overlap_with() -> None:
    assert overlapping({"c0": CAMERAS["c0"]}) == frozenset()
    assert overlapping({}) == frozenset()
