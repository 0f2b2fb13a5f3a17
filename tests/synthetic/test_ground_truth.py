"""The ground truth agrees with the pictures."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from synthetic import CameraTruth, Scene
from synthetic.drawing.clothing import choose_distinct_outfit
from synthetic.ground_truth import measure_truth
from synthetic.room.layouts import ROOM
from synthetic.room.room_world import RoomWorld
from synthetic.walking.trajectory import Pose

SIZE = (320, 180)


@pytest.fixture(scope="module")
def crowd() -> Scene:
    return Scene("room", 3, 4, 0, *SIZE)


def room_world(scene: Scene) -> RoomWorld:
    assert isinstance(scene.world, RoomWorld)
    return scene.world


def stand(scene: Scene, camera: int, *places: tuple[float, float]) -> CameraTruth:
    """Return the ground truth of people who stand at given places."""
    camera_view = room_world(scene).camera_view(camera)
    poses = [Pose(x, y, 0.0, 0.0, 0.0) for x, y in places]
    return measure_truth(
        camera_view,
        camera_view.draw_visible_people(
            poses, [choose_distinct_outfit(walker, 0) for walker in range(len(places))]
        ),
    )


def overlap(box: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    low, high = np.maximum(box[:2], other[:2]), np.minimum(box[2:], other[2:])
    shared = float(np.prod(np.maximum(high - low, 0)))
    areas = [float(np.prod(one[2:] - one[:2])) for one in (box, other)]
    return shared / (sum(areas) - shared)


def test_a_box_is_where_the_picture_differs_from_the_empty_room() -> None:
    single = Scene("room", 2, 1, 4, *SIZE)
    found = []
    for camera in range(2):
        empty = single.clean_background(camera).astype(np.int16)
        for frame in range(30, 900, 60):
            truth = single.truth(frame)[camera]
            if not single.inside(frame)[0] or len(truth.ids) == 0 or truth.visibility[0] < 0.99:
                continue  # partly occluded, or in the dark corridor
            changed = np.abs(single.image(camera, frame).astype(np.int16) - empty).max(axis=2) > 50
            x, y, width, height = cv2.boundingRect(cv2.medianBlur(changed.astype(np.uint8), 3))
            found.append(overlap(truth.boxes[0], np.array([x, y, x + width, y + height], dtype=float)))
    assert len(found) >= 12
    assert np.mean(found) > 0.85
    assert min(found) > 0.6


def test_rows_belong_together_and_boxes_lie_in_the_picture(crowd: Scene) -> None:
    for frame in range(0, 3000, 130):
        for truth in crowd.truth(frame):
            assert truth.boxes.shape == (len(truth.ids), 4)
            assert truth.visibility.shape == truth.ids.shape
            assert list(truth.ids) == sorted(set(truth.ids.tolist()))
            assert set(truth.ids.tolist()) <= {1, 2, 3, 4}
            assert (truth.boxes[:, :2] >= 0).all()
            assert (truth.boxes[:, 2:] <= SIZE).all()
            assert (truth.boxes[:, 2:] > truth.boxes[:, :2]).all()
            assert ((truth.visibility >= 0) & (truth.visibility <= 1)).all()


def test_the_homography_takes_the_feet_to_the_ground_position(crowd: Scene) -> None:
    errors = []
    for frame in range(20, 1500, 70):
        where = crowd.ground_positions(frame)
        for camera, truth in enumerate(crowd.truth(frame)):
            matrix = crowd.homography(camera)
            assert matrix is not None
            for number, box, visible in zip(truth.ids, truth.boxes, truth.visibility, strict=True):
                if visible < 0.99:
                    continue
                foot = matrix @ ((box[0] + box[2]) / 2, box[3], 1.0)
                errors.append(np.hypot(*(foot[:2] / foot[2] - where[number - 1])))
    assert len(errors) > 80
    # The box ends at the nearer foot's toe, a step ahead of the body's middle.
    assert np.median(errors) < 0.35
    assert np.quantile(errors, 0.95) < 0.8


def test_a_person_has_the_same_height_in_every_camera(crowd: Scene) -> None:
    """The projected height at the ground position is the top of the box."""
    where = (4.5, 4.0)
    for camera in range(3):
        truth = stand(crowd, camera, where)
        top, _ = (
            room_world(crowd).view(camera).project(np.array([[*where, choose_distinct_outfit(0, 0).height]]))
        )
        assert truth.boxes[0, 1] == pytest.approx(
            top[0, 1], abs=0.06 * (truth.boxes[0, 3] - truth.boxes[0, 1])
        )


def test_visibility_falls_the_more_another_person_stands_in_front(crowd: Scene) -> None:
    camera = np.array(room_world(crowd).view(0).center[:2])
    behind = np.array([4.2, 5.2])
    ahead = (camera - behind) / np.linalg.norm(camera - behind)
    offsets = np.array([-ahead[1], ahead[0]])
    shares = []
    for distance in (1.2, 0.45, 0.3, 0.15, 0.0):
        in_front = behind + 0.8 * ahead + distance * offsets
        truth = stand(crowd, 0, tuple(behind), tuple(in_front))
        assert list(truth.ids) == [1, 2]
        assert truth.visibility[1] == 1.0
        shares.append(float(truth.visibility[0]))
    assert shares[0] == 1.0
    assert shares == sorted(shares, reverse=True)
    assert shares[-1] < 0.5


def test_visibility_does_not_depend_on_the_order_of_people(crowd: Scene) -> None:
    one, other = (4.2, 5.2), (3.85, 4.75)
    forward, swapped = stand(crowd, 0, one, other), stand(crowd, 0, other, one)
    assert forward.visibility[0] < 0.9
    assert swapped.visibility[1] < 0.9


def test_furniture_occludes_people_behind_it_and_not_in_front(crowd: Scene) -> None:
    camera = room_world(crowd).view(0).center[:2]
    (piece,) = (piece for piece in ROOM.furniture if piece.name == "pillar")
    west, south, east, north = piece.footprint
    pillar = np.array([(west + east) / 2, (south + north) / 2])
    sight = (pillar - camera) / np.linalg.norm(pillar - camera)
    assert stand(crowd, 0, tuple(pillar + 0.9 * sight)).visibility[0] < 0.4
    assert stand(crowd, 0, tuple(pillar - 0.9 * sight)).visibility[0] == 1.0


def test_the_pictures_edge_lowers_visibility(crowd: Scene) -> None:
    near = stand(crowd, 1, (8.2, 1.4))
    assert near.visibility[0] < 0.9
    assert near.boxes[0, 3] == SIZE[1]


def test_a_person_who_left_by_the_door_is_in_no_picture(crowd: Scene) -> None:
    (door,) = (door for door in ROOM.doors if door.wall == "north")
    hidden = ROOM.beyond(door, 2.3, 0.75)  # in the corridor, beside the door
    assert all(len(stand(crowd, camera, hidden).ids) == 0 for camera in range(3))
    doorway = ROOM.beyond(door, 0.0, 0.3)
    assert list(stand(crowd, 1, doorway).ids) == [1]
    assert 0 < stand(crowd, 1, doorway).visibility[0] <= 1
