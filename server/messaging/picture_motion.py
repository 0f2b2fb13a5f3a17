"""Where a camera's picture was before the camera was knocked: there its homography holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from server.messaging.camera_status import PictureMotion
from tracking.detectors.background.motion import Motion

Floats = NDArray[np.float64]


def calibrated_boxes(boxes: Floats, motion: PictureMotion | None, size: tuple[int, int]) -> Floats:
    """Return boxes ``(..., 4)``, pixels of the site's image, where they were before a camera moved."""
    if motion is None:
        return boxes
    return _motion(motion).move_boxes_back(boxes.reshape(-1, 4), size).reshape(boxes.shape)


def shown_boxes(boxes: Floats, motion: PictureMotion | None, size: tuple[int, int]) -> Floats:
    """Return boxes ``(..., 4)`` of before a camera moved where the site's image shows them now, pixels."""
    if motion is None:
        return boxes
    return _motion(motion).move_boxes(boxes.reshape(-1, 4), size).reshape(boxes.shape)


def moved_homography(homography: Floats, motion: PictureMotion | None, size: tuple[int, int]) -> Floats:
    """Return the homography `(3, 3)` of a camera that has moved, from the site's image of a size."""
    if motion is None:
        return homography
    moved = np.vstack([_motion(motion).matrix(size), [0.0, 0.0, 1.0]])
    return np.asarray(homography @ np.linalg.inv(moved))


def _motion(motion: PictureMotion) -> Motion:
    return Motion(motion.x, motion.y, motion.grow, motion.turn)
