"""The occupancy reference tracker: the grid, trajectories over it, and identities after a meeting."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.bestview.occupancy.appearance_association import (
    MeetingSettings,
    PathAppearance,
    assign_ids,
)
from benchmarks.bestview.occupancy.floor_grid import CameraView, GridSettings, build_grid
from benchmarks.bestview.occupancy.ground_trajectories import (
    TrajectorySettings,
    moving_average,
    rows_of,
    trajectory_of,
)
from benchmarks.bestview.occupancy.homography_alignment import align_homographies
from benchmarks.bestview.occupancy.shortest_paths import GridPath
from bestview import to_ground
from tracking.detectors.background.height_model import HeightModel
from tracking.motchallenge import MotRow

LINE = HeightModel(slope=0.5, offset=20.0, min_height=10.0)
"""In a picture of 200 by 100 pixels people are 20 rows tall at its upper edge and 70 at its lower one."""


def plan_view(left: float) -> CameraView:
    """A camera whose picture is the floor itself, ten pixels to a unit of the ground."""
    homography = np.array([[0.1, 0.0, left], [0.0, 0.1, 0.0], [0.0, 0.0, 1.0]])
    return CameraView(homography, (200, 100), LINE, np.ones((50, 100)))


def test_the_grid_covers_what_is_seen_and_its_border_is_the_gate() -> None:
    view = plan_view(0.0)
    floor = build_grid([view], GridSettings(step=0.2, gate=0.2, min_visible=0.5))
    assert (view.visible_share(view.boxes(floor.places, 0.34)) >= 0.5).all()
    neighbors = (floor.moves < len(floor.places)).sum(axis=1)
    assert floor.gates[neighbors < 9].all()
    assert not floor.gates.all()
    for place, around in enumerate(floor.moves):
        assert all(place in floor.moves[neighbor] for neighbor in around if neighbor < len(floor.places)), (
            "there and back"
        )
        assert place in around
    step = np.unique(np.diff(np.unique(floor.places[:, 0])).round(9))
    assert step == pytest.approx([0.2 * floor.person])


def test_a_path_becomes_the_boxes_of_who_walks_it() -> None:
    view = plan_view(0.0)
    floor = build_grid([view], GridSettings(step=0.2))
    middle = int(np.abs(floor.places - floor.places.mean(axis=0)).sum(axis=1).argmin())
    q = np.zeros((5, len(floor.places)))
    q[:, middle] = 0.9
    walk = trajectory_of(floor, q, GridPath(1, np.full(3, middle)), 2)
    np.testing.assert_allclose(walk.places, np.tile(floor.places[middle], (3, 1)), atol=1e-6)
    rows = rows_of(view, [walk], [np.array([4, 4, 9])], TrajectorySettings(aspect=0.4))
    assert [(row.frame, row.id) for row in rows] == [(2, 4), (3, 4), (4, 9)]
    x, y = floor.places[middle] * 10.0
    tall = 0.5 * y + 20.0
    np.testing.assert_allclose(
        rows[0].box, (x - 0.2 * tall, max(y - tall, 0.0), x + 0.2 * tall, y), atol=1e-4
    )


def test_places_are_smoothed_evenly_so_that_straight_walks_stay_straight() -> None:
    straight = np.stack([np.arange(9.0), 2.0 * np.arange(9.0)], axis=1)
    np.testing.assert_allclose(moving_average(straight, 3), straight)
    np.testing.assert_allclose(moving_average(np.eye(3)[:, :2], 1)[1], [1 / 3, 1 / 3])


def test_homographies_that_disagree_are_shifted_until_feet_agree() -> None:
    rng = np.random.default_rng(5)
    there, ground = rng.uniform((60, 50), (140, 90), (80, 2)), {}
    boxes: dict[str, list[MotRow]] = {}
    shifts = {"c0": (0.6, -0.2), "c1": (-0.4, 0.3), "c2": (-0.2, -0.1)}
    for camera, (x, y) in shifts.items():
        ground[camera] = plan_view(0.0).homography + np.array([[0, 0, x], [0, 0, y], [0, 0, 0]])
        boxes[camera] = [
            MotRow(at + 1, -1, foot[0] - 5, foot[1] - 30, 10, 30) for at, foot in enumerate(there)
        ]
    moved = align_homographies(boxes, ground, dict.fromkeys(shifts, 100), 5.0)
    places = [to_ground(moved[camera], there) for camera in shifts]
    np.testing.assert_allclose(places[0], places[1], atol=1e-9)
    np.testing.assert_allclose(places[0], places[2], atol=1e-9)
    np.testing.assert_allclose(places[0], there / 10.0, atol=1e-9, err_msg="the shifts add up to nothing")


FRAMES, MEET = 60, slice(25, 35)


def walker(look: np.ndarray, away: float, first: int = 0) -> PathAppearance:
    """Somebody who is `away` from the middle, but for a meeting there."""
    places = np.tile([away, 0.0], (FRAMES, 1))
    places[MEET] = 0.0
    pixels = np.full((FRAMES, 2), 100.0, dtype=np.float32)
    return PathAppearance(first, places[first:], look[first:], pixels[first:])


def histograms(before: int, after: int) -> np.ndarray:
    rows = np.zeros((FRAMES, 2, 3), dtype=np.float32)
    rows[:30, :, before] = rows[30:, :, after] = 1.0
    return rows


def test_paths_that_swapped_two_people_give_their_numbers_back() -> None:
    swapped = [walker(histograms(0, 1), -5.0), walker(histograms(1, 0), 5.0)]
    one, other = assign_ids(swapped, 1.0, MeetingSettings())
    assert one.tolist() == [1] * 30 + [2] * 30
    assert other.tolist() == [2] * 30 + [1] * 30


@pytest.mark.parametrize(
    "walkers",
    [
        [walker(histograms(0, 0), -5.0), walker(histograms(1, 1), 5.0)],
        [walker(histograms(2, 2), -5.0), walker(histograms(2, 2), 5.0)],
        [walker(histograms(0, 1), -5.0), walker(histograms(1, 0), 5.0, first=28)],
    ],
    ids=["told apart and right", "alike", "nothing known of one"],
)
def test_paths_keep_their_numbers_where_colors_say_nothing_else(walkers: list[PathAppearance]) -> None:
    numbers = assign_ids(walkers, 1.0, MeetingSettings())
    assert [set(number.tolist()) for number in numbers] == [{1}, {2}]
