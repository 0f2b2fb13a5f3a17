"""A floor is divided so that every place has one area, and every area its share of the cameras."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import FloorAreas, to_ground

SIZE = (640, 360)


def camera_at(x: float, y: float, turn: float) -> NDArray[np.float64]:
    """Return the homography of a level camera, 3 m above the floor, looking in a direction."""
    along, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    level = np.array([[400.0, 320.0, 0.0], [0.0, 100.0, 1200.0], [0.0, 1.0, 0.0]])
    place = np.array([x, y])
    to_camera = np.array([[*across, -across @ place], [*along, -along @ place], [0.0, 0.0, 1.0]])
    return np.linalg.inv(level @ to_camera)


def hall(seed: int, cameras: int) -> dict[str, NDArray[np.float64] | None]:
    """Return cameras all over a hall."""
    rng = np.random.default_rng(seed)
    return {
        f"c{number}": camera_at(rng.uniform(0, 60), rng.uniform(0, 60), rng.uniform(0, 6.3))
        for number in range(cameras)
    }


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.integers(8, 20))
def test_every_place_has_one_area_and_every_camera_is_where_it_looks(
    seed: int, count: int, cameras: int
) -> None:
    homographies = hall(seed, cameras)
    areas = FloorAreas(homographies, dict.fromkeys(homographies, SIZE), count)
    places = np.random.default_rng(seed).uniform(-1e3, 1e3, (200, 2))
    found = areas.area_of(places)
    assert found.min() >= 0
    assert found.max() < count
    own = [areas.cameras_of(area) for area in range(count)]
    assert sorted(camera for cameras in own for camera in cameras) == sorted(homographies)
    assert min(map(len, own)) >= 1
    for area in range(count):
        least_x, least_y, largest_x, largest_y = areas.floor_of(area)
        middle = np.array([[(least_x + largest_x) / 2, (least_y + largest_y) / 2]])
        assert areas.area_of(middle).tolist() == [area]
        assert not set(areas.also_seen_by(area)) & set(own[area])


def test_unknown_places_are_in_no_area_and_uncalibrated_cameras_in_the_first() -> None:
    homographies = {**hall(1, 4), "corridor": None}
    areas = FloorAreas(homographies, dict.fromkeys(homographies, SIZE), 2)
    assert areas.area_of(np.array([[np.nan, 1.0], [3.0, 4.0]])).tolist()[0] == -1
    assert "corridor" in areas.cameras_of(0)
    assert "corridor" not in areas.cameras_of(1)


def test_a_small_area_is_of_the_cameras_that_look_at_it_alone() -> None:
    homographies = {"west": camera_at(0, 0, np.pi), "east": camera_at(100, 0, 0.0)}
    areas = FloorAreas(homographies, dict.fromkeys(homographies, SIZE), 2)
    assert sorted(areas.cameras_of(area) for area in range(2)) == [("east",), ("west",)]
    assert [areas.also_seen_by(area) for area in range(2)] == [(), ()]


def test_a_camera_that_sees_the_floor_of_another_area_is_taken_in_there_too() -> None:
    homographies = {"one": camera_at(0, 0, 0.0), "facing": camera_at(20, 0, np.pi)}
    areas = FloorAreas(homographies, dict.fromkeys(homographies, SIZE), 2)
    own = [areas.cameras_of(area)[0] for area in range(2)]
    assert sorted(own) == ["facing", "one"]
    assert [areas.also_seen_by(area) for area in range(2)] == [(own[1],), (own[0],)]


def test_more_areas_than_calibrated_cameras_are_refused() -> None:
    homographies = {"a": camera_at(0, 0, 0.0), "b": None}
    with pytest.raises(ValueError, match="2 areas need as many calibrated cameras at least, but there are 1"):
        FloorAreas(homographies, dict.fromkeys(homographies, SIZE), 2)


def test_cameras_that_see_the_same_cannot_be_divided() -> None:
    homographies = dict.fromkeys("abcd", camera_at(0, 0, 0.0))
    with pytest.raises(ValueError, match="too alike to divide the floor into 2 areas"):
        FloorAreas(homographies, dict.fromkeys(homographies, SIZE), 2)


def test_everything_that_a_camera_sees_is_on_some_floor() -> None:
    homographies = {"west": camera_at(0, 0, np.pi), "east": camera_at(100, 0, 0.0)}
    areas = FloorAreas(homographies, dict.fromkeys(homographies, SIZE), 2)
    edges = np.array([[0.0, 360.0], [320.0, 360.0], [640.0, 360.0], [0.0, 120.0], [640.0, 120.0]])
    for camera in homographies.values():
        for x, y in to_ground(camera, edges).tolist():
            floors = [areas.floor_of(area) for area in range(2)]
            assert any(
                least_x <= x <= most_x and least_y <= y <= most_y
                for least_x, least_y, most_x, most_y in floors
            )
