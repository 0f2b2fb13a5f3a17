"""A network's boxes follow what is in them until the network runs again."""

from __future__ import annotations

import numpy as np

from fakes.tracking.drawn_people import Figure, picture
from tracking.boxes import iou
from tracking.detectors.fused.carried_boxes import CarriedBoxes
from tracking.types import Detections

WALKERS = [Figure(20, 200, speed=3.0), Figure(330, 230, speed=-4.0, color=(190, 60, 40))]


def found_in(frame: int) -> Detections:
    boxes = np.array([walker.box(frame) for walker in WALKERS])
    return Detections(boxes, np.array([0.9, 0.6]), np.empty((2, 0)))


def test_boxes_follow_people_who_walk() -> None:
    carried = CarriedBoxes()
    carried.renew(picture(WALKERS, 0), found_in(0))
    for frame in range(1, 6):
        carried.carry(picture(WALKERS, frame))
    assert (iou(found_in(0).boxes, found_in(5).boxes) < 0.5).all()
    assert (iou(carried.found.boxes, found_in(5).boxes) > 0.85).all()
    np.testing.assert_array_equal(carried.found.scores, [0.9, 0.6])


def test_boxes_of_people_who_stand_stay() -> None:
    standing = [Figure(100, 200)]
    carried = CarriedBoxes()
    box = standing[0].box(0)
    carried.renew(picture(standing, 0), Detections(box[None], np.ones(1), np.empty((1, 0))))
    for frame in range(1, 6):
        carried.carry(picture(standing, frame))
    np.testing.assert_allclose(carried.found.boxes[0], box, atol=1.0)


def test_nothing_is_carried_before_the_first_run() -> None:
    carried = CarriedBoxes()
    carried.carry(picture(WALKERS, 0))
    assert len(carried.found) == 0
