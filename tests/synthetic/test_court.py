"""The court scene: two teams in two outfits play a plausible game, and the ground truth fits the pictures."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from synthetic import Scene
from synthetic.court.court import COURT, SPORTS_HALL
from synthetic.court.game import Game
from synthetic.court.gym_surfaces import floor
from synthetic.drawing.clothing import choose_team_outfit
from synthetic.drawing.skeleton import Joint, place_joints
from synthetic.ground_truth import measure_truth
from synthetic.room.room_world import RoomWorld
from synthetic.walking.choreographed_crowd import ROUND, ChoreographedCrowd
from synthetic.walking.trajectory import Pose

RATE = 10  # samples a second
SIZE = (320, 180)
PLAYERS = 10


@pytest.fixture(scope="module", params=range(3))
def paths(request: pytest.FixtureRequest) -> np.ndarray:
    """Two minutes of a game: ``(T, PLAYERS, 2)`` meters."""
    crowd = ChoreographedCrowd(Game(COURT, PLAYERS, request.param), [1.85] * PLAYERS)
    return np.array([[(pose.x, pose.y) for pose in crowd.poses(t / RATE)] for t in range(120 * RATE)])


def test_players_sprint_turn_and_stand(paths: np.ndarray) -> None:
    step = np.diff(paths, axis=0)
    speed = np.hypot(*step.transpose(2, 0, 1)) * RATE
    assert 4.5 < speed.max() < 7.0
    assert 0.8 < np.median(speed) < 2.5
    assert np.mean(speed > 3) > 0.12
    fast = speed > 1.0
    heading = np.arctan2(step[..., 1], step[..., 0])
    turned = np.abs(np.angle(np.exp(1j * np.diff(heading, axis=0))))
    assert np.degrees(turned[fast[1:] & fast[:-1]]).max() > 10  # in a tenth of a second


def test_players_do_not_collide_or_leave_the_floor(paths: np.ndarray) -> None:
    gaps = np.linalg.norm(paths[:, :, None] - paths[:, None], axis=3)[:, *np.triu_indices(PLAYERS, 1)]
    assert np.mean(gaps < 0.45) < 0.001
    west, south, east, north = COURT.bounds
    assert (paths > (west - 1, south - 1)).all()
    assert (paths < (east + 1, north + 1)).all()
    for piece in SPORTS_HALL.furniture:
        low, high = np.array(piece.footprint[:2]), np.array(piece.footprint[2:])
        if piece.name != "board":  # players do run below the boards
            assert not ((paths > low) & (paths < high)).all(axis=2).any()


def test_the_game_alternates_between_the_baskets(paths: np.ndarray) -> None:
    """At the end of each round all players are in the attacked half."""
    for number in range(1, 12):
        east = paths[int(number * ROUND * RATE) - 1, :, 0] > SPORTS_HALL.width / 2
        assert east.mean() == (1.0 if (number - 1) % 2 == 0 else 0.0)


def test_defenders_stay_close_to_their_opponents(paths: np.ndarray) -> None:
    reds, blues = paths[:, ::2], paths[:, 1::2]
    nearest = np.linalg.norm(reds[:, :, None] - blues[:, None], axis=3).min(axis=2)
    assert np.median(nearest) < 2.0
    assert np.mean(nearest < 1.0) > 0.05


def test_each_team_has_one_outfit() -> None:
    first, second = (
        [choose_team_outfit(player, team) for player in range(team, PLAYERS, 2)] for team in range(2)
    )
    assert len({(outfit.upper, outfit.lower) for outfit in first}) == 1
    assert len({(outfit.upper, outfit.lower) for outfit in second}) == 1
    colors = np.array([[first[0].upper, second[0].upper]], dtype=np.float32)
    red, blue = cv2.cvtColor(colors, cv2.COLOR_RGB2LAB)[0]
    assert np.linalg.norm(red - blue) > 60


def test_boxes_end_at_the_feet_on_the_floor() -> None:
    scene = Scene("court", 4, PLAYERS, 1, *SIZE)
    errors = []
    for frame in range(10, 900, 90):
        where = scene.ground_positions(frame)
        for camera, truth in enumerate(scene.truth(frame)):
            matrix = scene.homography(camera)
            assert matrix is not None
            whole = (truth.visibility > 0.99) & (truth.boxes[:, 3] < SIZE[1])
            for number, box in zip(truth.ids[whole], truth.boxes[whole], strict=True):
                foot = matrix @ ((box[0] + box[2]) / 2, box[3], 1.0)
                errors.append(np.hypot(*(foot[:2] / foot[2] - where[number - 1])))
    assert len(errors) > 60
    assert np.median(errors) < 0.5


def test_every_player_is_visible_in_some_camera() -> None:
    scene = Scene("court", 4, PLAYERS, 2, *SIZE)
    for frame in range(0, 1500, 125):
        best = np.zeros(PLAYERS)
        for truth in scene.truth(frame):
            best[truth.ids - 1] = np.maximum(best[truth.ids - 1], truth.visibility)
        assert best.min() > 0.5


def test_a_board_occludes_people_behind_it() -> None:
    world = Scene("court", 1, 1, 1, *SIZE).world
    assert isinstance(world, RoomWorld)
    view = world.view(0)
    (board,) = (piece for piece in SPORTS_HALL.furniture if piece.name == "board" and piece.footprint[0] < 12)
    _, south, east, north = board.footprint
    middle = np.array([east - 0.45, (south + north) / 2, 3.4])
    sight = middle - view.center
    floor_point = view.center + sight * (view.center[2] - 1.2) / -sight[2]
    camera_view = world.camera_view(0)
    pose = Pose(float(floor_point[0]), float(floor_point[1]), 0.0, 0.0, 0.0)
    truth = measure_truth(camera_view, camera_view.draw_visible_people([pose], [choose_team_outfit(0, 0)]))
    assert truth.visibility[0] < 0.6


def test_runners_lean_forward_and_bend_their_arms() -> None:
    walks, runs = (place_joints(Pose(0.0, 0.0, 0.0, 0.4, speed), 1.8) for speed in (1.2, 4.6))
    assert runs[Joint.HEAD, 0] - runs[Joint.BELLY, 0] > walks[Joint.HEAD, 0] - walks[Joint.BELLY, 0]
    hands = (Joint.HAND_L, Joint.HAND_R)
    assert min(runs[hand, 2] for hand in hands) > min(walks[hand, 2] for hand in hands) + 0.1
    assert (runs[:, 2] > 0).all()


def test_the_lines_are_where_the_court_is() -> None:
    points = np.array([[12.0, 5.0, 0.0], [12.0 + 1.8, 7.25, 0.0], [2.0, 4.0, 0.0], [10.0, 4.0, 0.0]])
    center, circle, end, bare = floor(SPORTS_HALL, points)
    for line in (center, circle, end):
        assert line.min() > 0.7
    assert bare.min() < 0.45
