"""People stay where they are on the floor when a camera is knocked."""

from __future__ import annotations

import numpy as np
import pytest

from bestview import to_ground
from fakes.service.scripted_cameras import HEIGHT, WIDTH, camera_tracks, epoch_of
from server.messaging.camera_status import PictureMotion
from server.messaging.picture_motion import calibrated_boxes, moved_homography
from server.service.identity.camera_window import WindowReader
from tracking.detectors.background.motion import Motion

SIZE = (WIDTH, HEIGHT)
MOTION = Motion(3.0, -2.0, turn=0.02)
MESSAGE = PictureMotion(x=3.0, y=-2.0, grow=0.0, turn=0.02)
BOX = np.array([[20.0, 10.0, 30.0, 40.0]])
HOMOGRAPHY = np.array([[0.1, 0.0, 0.0], [0.0, 0.2, 1.0], [0.0, 0.01, 1.0]])


def test_boxes_are_moved_back_to_where_the_homography_holds() -> None:
    moved = MOTION.move_boxes(BOX, SIZE)
    np.testing.assert_allclose(calibrated_boxes(moved, MESSAGE, SIZE), BOX)
    assert calibrated_boxes(moved, None, SIZE) is moved


def test_the_moved_homography_maps_a_moved_point_to_the_same_place() -> None:
    point = np.array([[25.0, 40.0]])
    moved = point @ MOTION.matrix(SIZE)[:, :2].T + MOTION.matrix(SIZE)[:, 2]
    there = to_ground(moved_homography(HOMOGRAPHY, MESSAGE, SIZE), moved)
    np.testing.assert_allclose(there, to_ground(HOMOGRAPHY, point))


def test_tracks_for_identity_do_not_show_that_the_camera_was_knocked() -> None:
    left, top, right, bottom = MOTION.move_boxes(BOX, SIZE)[0].tolist()
    windows = [
        WindowReader(SIZE).read(epoch_of(0, camera_tracks("c0", 0, {1: box}, motion=motion)))[0]
        for box, motion in (
            (tuple(BOX[0].tolist()), None),
            ((left, top, right, bottom), MESSAGE),
        )
    ]
    still, knocked = (window.fresh_tracks()[0].boxes for window in windows)
    np.testing.assert_allclose(still, knocked)
    assert windows[1].boxes[0, 0] == pytest.approx([left, top, right, bottom]), (
        "the page draws it where it is"
    )
