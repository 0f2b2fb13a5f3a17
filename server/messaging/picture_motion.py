"""Maps boxes of a camera that was knocked or turned to where they were before, for its homography."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from server.media.letterbox import Letterbox
from server.messaging.camera_status import PictureMotion
from server.messaging.number_types import COORDINATE_MAX
from tracking.detectors.background.views.view_matching import TURNED
from tracking.homographies import map_points

Floats = NDArray[np.float64]


def picture_motion(matrix: Floats, size: tuple[int, int]) -> PictureMotion:
    """Return the message of a homography (3, 3) of the site's image, of a size (w, h).

    Raises:
        ValueError: what was in the middle is not in front of the camera any more, or a number is too large.
    """
    matrix = matrix / np.cbrt(np.linalg.det(matrix))  # what is in front of the camera has a positive depth
    rows = matrix.tolist()
    middle = np.array([[size[0] / 2.0, size[1] / 2.0], [size[0] / 2.0 + 1.0, size[1] / 2.0]])
    there, beside = map_points(matrix, middle)
    across, down = (beside - there).tolist()
    if not (np.isfinite(beside).all() and np.abs([*matrix.ravel(), *there]).max() <= COORDINATE_MAX):
        raise ValueError("the middle of the picture has moved out of sight")
    return PictureMotion(
        matrix=(tuple(rows[0]), tuple(rows[1]), tuple(rows[2])),
        pixels=float(np.linalg.norm(there - middle[0])),
        degrees=abs(math.degrees(math.atan2(down, across))),
    )


def is_turned(motion: PictureMotion | None, size: tuple[int, int]) -> bool:
    """Return whether the camera of a site's image of a size (w, h) shows another part of the scene."""
    return motion is not None and motion.pixels > TURNED * size[0]


def calibrated_boxes(boxes: Floats, motion: PictureMotion | None) -> Floats:
    """Return boxes ``(..., 4)``, pixels of the site's image, where they were before a camera moved."""
    return boxes if motion is None else moved_boxes(np.linalg.inv(np.array(motion.matrix)), boxes)


def shown_boxes(boxes: Floats, motion: PictureMotion | None) -> Floats:
    """Return boxes ``(..., 4)`` of before a camera moved where the site's image shows them now, pixels."""
    return boxes if motion is None else moved_boxes(np.array(motion.matrix), boxes)


def moved_homography(homography: Floats, motion: PictureMotion | None) -> Floats:
    """Return the homography `(3, 3)` from the site's image to the ground of a camera that has moved."""
    return homography if motion is None else np.asarray(homography @ np.linalg.inv(np.array(motion.matrix)))


def camera_motion(motion: PictureMotion, letterbox: Letterbox) -> Floats:
    """Return a motion of the site's image as one of the camera's own, (3, 3)."""
    to_site = letterbox.homography
    return np.asarray(np.linalg.inv(to_site) @ np.array(motion.matrix) @ to_site)


def moved_boxes(matrix: Floats, boxes: Floats) -> Floats:
    """Return upright boxes ``(..., 4)`` under a homography (3, 3), which maps their feet and heads."""
    flat = boxes.reshape(-1, 4)
    middle = (flat[:, 0] + flat[:, 2]) / 2.0
    heads, feet = (map_points(matrix, np.stack([middle, flat[:, row]], axis=1)) for row in (1, 3))
    tall = np.linalg.norm(heads - feet, axis=1)
    before = np.maximum(flat[:, 3] - flat[:, 1], np.finfo(float).tiny)
    half = (flat[:, 2] - flat[:, 0]) / 2.0 * tall / before
    moved = np.stack([feet[:, 0] - half, feet[:, 1] - tall, feet[:, 0] + half, feet[:, 1]], axis=1)
    return np.asarray(moved.reshape(boxes.shape))
