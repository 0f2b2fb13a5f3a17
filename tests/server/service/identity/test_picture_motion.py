"""People stay where they are on the floor when a camera is knocked."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from bestview import to_ground
from fakes.service.scripted_cameras import HEIGHT, WIDTH, camera_tracks, epoch_of
from server.messaging.packed_arrays import pack_boxes
from server.messaging.picture_motion import calibrated_boxes, moved_homography, picture_motion, shown_boxes
from server.service.identity.camera_window import WindowReader
from server.service.identity.undetected_frames import UndetectedFrames
from tracking.detectors.background.motion import Motion

SIZE = (WIDTH, HEIGHT)
MOTION = Motion(3.0, -2.0, turn=0.02)
MESSAGE = picture_motion(MOTION.homography(SIZE), SIZE)
TURN = np.array([[1.1, 0.02, -40.0], [0.05, 1.05, -3.0], [5e-4, 1e-5, 1.0]])
BOX = np.array([[20.0, 10.0, 30.0, 40.0]])
HOMOGRAPHY = np.array([[0.1, 0.0, 0.0], [0.0, 0.2, 1.0], [0.0, 0.01, 1.0]])


@pytest.mark.parametrize("matrix", [MOTION.homography(SIZE), TURN])
def test_boxes_are_moved_back_to_where_the_homography_holds(matrix: np.ndarray) -> None:
    message = picture_motion(matrix, SIZE)
    moved = shown_boxes(BOX, message)
    foot = matrix @ [25.0, 40.0, 1.0]
    np.testing.assert_allclose([(moved[0, 0] + moved[0, 2]) / 2, moved[0, 3]], foot[:2] / foot[2])
    assert moved[0, 3] - moved[0, 1] == pytest.approx(30.0, rel=0.15)
    back = calibrated_boxes(moved, message)
    np.testing.assert_allclose(back[:, 3], BOX[:, 3], atol=0.1)
    np.testing.assert_allclose(back, BOX, atol=1.5)
    assert calibrated_boxes(moved, None) is moved


def test_a_box_that_is_hidden_or_beyond_the_horizon_is_nowhere() -> None:
    beyond = picture_motion(np.array([[1.0, 0.0, -40.0], [0.0, 1.0, 0.0], [0.05, 0.0, -1.4]]), SIZE)
    hidden = np.full((1, 4), np.nan)
    assert np.isnan(shown_boxes(np.concatenate([hidden, BOX]), beyond)).all()


@pytest.mark.parametrize("matrix", [MOTION.homography(SIZE), TURN])
def test_the_moved_homography_maps_a_moved_point_to_the_same_place(matrix: np.ndarray) -> None:
    moved = matrix @ [25.0, 40.0, 1.0]
    there = to_ground(moved_homography(HOMOGRAPHY, picture_motion(matrix, SIZE)), moved[None, :2] / moved[2])
    np.testing.assert_allclose(there, to_ground(HOMOGRAPHY, np.array([[25.0, 40.0]])))


def test_a_turn_that_leaves_nothing_in_front_of_the_camera_has_no_message() -> None:
    with pytest.raises(ValueError, match="out of sight"):
        picture_motion(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.05, 0.0, 0.1]]), SIZE)
    scaled = picture_motion(-3.0 * MOTION.homography(SIZE), SIZE)
    np.testing.assert_allclose(shown_boxes(BOX, scaled), shown_boxes(BOX, MESSAGE))


def test_a_motion_says_how_far_the_middle_has_moved() -> None:
    assert (MESSAGE.pixels, MESSAGE.degrees) == pytest.approx((np.hypot(3.0, 2.0), 1.146), rel=0.01)
    with pytest.raises(msgspec.ValidationError, match="can be inverted"):
        msgspec.convert({"matrix": [[0.0] * 3] * 3, "pixels": 0.0, "degrees": 0.0}, type(MESSAGE))


def test_tracks_for_identity_do_not_show_that_the_camera_was_knocked() -> None:
    left, top, right, bottom = shown_boxes(BOX, MESSAGE)[0].tolist()
    windows = [
        WindowReader(SIZE).read(epoch_of(0, camera_tracks("c0", 0, {1: box}, motion=motion)))[0]
        for box, motion in (
            (tuple(BOX[0].tolist()), None),
            ((left, top, right, bottom), MESSAGE),
        )
    ]
    still, knocked = (window.fresh_tracks()[0].boxes for window in windows)
    np.testing.assert_allclose(still, knocked, atol=0.1)
    assert windows[1].boxes[0, 0] == pytest.approx([left, top, right, bottom]), (
        "the page draws it where it is"
    )


def test_a_portrait_camera_with_much_of_its_own_picture_hidden_sees_nobody() -> None:
    size = (WIDTH // 4, HEIGHT)
    left = (WIDTH - size[0]) / 2
    for share, is_detecting in ((0.2, True), (0.4, False)):
        covered = pack_boxes([(left, 0.0, left + share * size[0], float(HEIGHT))])
        message = camera_tracks("c0", 0, {}, size=size, covered=covered)
        windows = WindowReader(SIZE).read(epoch_of(0, message))
        assert (
            bool(UndetectedFrames().detecting_cameras(windows, message.first, message.last)) is is_detecting
        )
