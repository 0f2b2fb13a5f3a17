"""Registration: a background is found again after the camera has moved, with people in the picture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from fakes.tracking.drawn_people import HEIGHT, SCENE, WIDTH, Figure, Picture, detect_all, picture
from tracking.boxes import iou
from tracking.detectors import BackgroundDetector
from tracking.detectors.background.light.tone_curve import IDENTITY
from tracking.detectors.background.motion import STILL, Motion
from tracking.detectors.background.registration import Registration

SIZE = (WIDTH, HEIGHT)
CROWD = [
    Figure(20 + 60 * k, 150 + 20 * k, 1.0 - 0.4 * k, color=(40, 60 * (k % 4), 250 - 60 * (k % 4)))
    for k in range(6)
]


def moved(image: Picture, motion: Motion) -> Picture:
    """Return the image of a camera that has moved."""
    return np.asarray(
        cv2.warpAffine(image, motion.matrix(SIZE), SIZE, borderMode=cv2.BORDER_REPLICATE), dtype=np.uint8
    )


def follow(registration: Registration, image: Picture) -> Motion:
    """Return the motion of the next frame; between looks the camera rests."""
    return registration.find(image, IDENTITY, None) if registration.is_due() else registration.rest


@pytest.mark.parametrize(
    "motion",
    [Motion(5.0, -3.3, turn=0.0175), Motion(-9.0, 5.0, turn=-0.026), Motion(2.0, 1.0, grow=0.02)],
)
def test_a_knock_is_found_in_half_a_second_behind_a_crowd(motion: Motion) -> None:
    registration = Registration()
    registration.set_background(SCENE)
    for frame in range(30):
        assert follow(registration, picture(CROWD, frame)) == STILL
    found = [follow(registration, moved(picture(CROWD, frame), motion)) for frame in range(30, 120)]
    assert max(each.distance(motion, SIZE) for each in found[12:]) < 0.5
    assert registration.rest.distance(motion, SIZE) < 0.5, "it is where the camera rests from now on"


def test_sway_is_followed_and_is_no_rest() -> None:
    registration = Registration()
    registration.set_background(SCENE)
    errors = []
    for frame in range(100):
        sway = Motion(2.0 * np.sin(frame / 7.0), 1.5 * np.sin(frame / 5.0))
        found = follow(registration, moved(picture(CROWD, frame), sway))
        errors.append(found.distance(sway, SIZE))
    assert np.mean(errors) < 0.4
    assert registration.rest.distance(STILL, SIZE) < 0.7


def test_people_are_detected_where_they_are_in_a_knocked_picture() -> None:
    walker, motion = Figure(10, 200, speed=2.0, begin=40), Motion(6.0, -4.0, turn=0.0175)
    detector = BackgroundDetector()
    detect_all(detector, [walker], range(90))
    overlaps = []
    for frame in range(90, 130):
        seen = detector.detect(moved(picture([walker], frame), motion))
        truth = motion.move_boxes(walker.box(frame)[None], SIZE)[0]
        sure = seen.boxes[seen.scores >= 0.4]
        overlaps.append(float(iou(sure, truth).max(initial=0.0)))
        centers = (sure[:, :2] + sure[:, 2:]) / 2.0
        assert ((centers > truth[:2]) & (centers < truth[2:])).all(), "nothing else is a person"
    assert np.mean(np.array(overlaps) >= 0.5) >= 0.95
    assert detector.camera_motion == pytest.approx(np.eye(3)), "it may come back"
    for frame in range(130, 175):
        detector.detect(moved(picture([walker], frame), motion))
    corners = np.array([[0.0, 0.0, 1.0], [SIZE[0], 0.0, 1.0], [0.0, SIZE[1], 1.0], [*SIZE, 1.0]])
    assert detector.camera_motion is not None
    errors = corners @ (detector.camera_motion - motion.homography(SIZE)).T
    assert np.linalg.norm(errors, axis=1).mean() < 0.8


def test_an_empty_or_plain_background_has_no_motion() -> None:
    registration = Registration()
    assert registration.find(SCENE, IDENTITY, None) == STILL
    registration.set_background(np.full_like(SCENE, 90))
    assert registration.find(SCENE, IDENTITY, None) == STILL


def test_boxes_of_a_frame_are_moved_back_to_where_they_are_in_the_background() -> None:
    motion, boxes = Motion(-9.0, 5.0, grow=0.02, turn=-0.026), np.array([[30.0, 80.0, 60.0, 160.0]])
    there = motion.move_boxes(boxes, SIZE)
    assert np.abs(there - boxes).max() > 3.0
    np.testing.assert_allclose(motion.move_boxes_back(there, SIZE), boxes)
