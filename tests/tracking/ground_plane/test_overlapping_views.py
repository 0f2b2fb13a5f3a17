"""Cameras overlap where people on the floor are seen by two of them, whatever the unit of the floor is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fakes.tracking.walked_floor import floor_views
from tracking.boxes import Floats
from tracking.ground_plane import GroundCamera, overlapping_cameras

CAMERAS = {name: view.camera for name, view in floor_views().items()}


def moved(camera: GroundCamera, change: Floats) -> GroundCamera:
    """Return a camera that sees as if the floor were moved, (3, 3)."""
    return replace(camera, homography=change @ camera.homography)


def shift(x: float, y: float) -> Floats:
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("unit", [0.01, 1.0, 100.0])
def test_cameras_around_a_floor_overlap_in_any_unit(unit: float) -> None:
    cameras = {name: moved(camera, np.diag([unit, unit, 1.0])) for name, camera in CAMERAS.items()}
    assert overlapping_cameras(cameras) == CAMERAS.keys()


def test_a_camera_of_another_room_is_left_alone() -> None:
    assert overlapping_cameras(CAMERAS | {"far": moved(CAMERAS["c0"], shift(100.0, 0.0))}) == CAMERAS.keys()


def test_cameras_back_to_back_see_nothing_together() -> None:
    camera = CAMERAS["c0"]
    behind = camera.to_ground(np.array([[camera.width / 2.0, 1e7]]))[0]
    turned = shift(*behind) @ np.diag([-1.0, -1.0, 1.0]) @ shift(*-behind)
    assert overlapping_cameras({"c0": camera, "back": moved(camera, turned)}) == frozenset()


def test_an_overview_and_a_camera_that_shows_a_part_of_it_large_overlap() -> None:
    camera = CAMERAS["c0"]
    cut = np.array([[0.2, 0.0, 0.4 * camera.width], [0.0, 0.2, 0.5 * camera.height], [0.0, 0.0, 1.0]])
    close = replace(camera, homography=camera.homography @ cut)
    assert overlapping_cameras({"all": camera, "close": close}) == {"all", "close"}


def test_one_camera_has_none_to_overlap_with() -> None:
    assert overlapping_cameras({"c0": CAMERAS["c0"]}) == frozenset()
    assert overlapping_cameras({}) == frozenset()
