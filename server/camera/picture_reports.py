"""What is wrong with a camera's picture, and how far it was knocked, as messages and log lines say it."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from server.messaging.camera_status import PictureMotion, motion_text, picture_text
from server.messaging.picture_motion import picture_motion
from tracking.homographies import map_points
from tracking.types import PictureCondition

Floats = NDArray[np.float64]

log = logging.getLogger(__name__)

_NOTICEABLE = 0.005
"""Motion, as a share of the picture's width, below which floor positions hardly change."""


def noticeable_motion(motion: Floats, size: tuple[int, int]) -> PictureMotion | None:
    """Return a homography (3, 3) of a picture of ``size`` (w, h) as a message; None: it hardly moves."""
    across, down = np.meshgrid(np.linspace(0.0, size[0], 5), np.linspace(0.0, size[1], 5))
    points = np.stack([across.ravel(), down.ravel()], axis=1)
    offsets = map_points(motion, points) - points
    if np.sqrt((offsets**2).sum(axis=1).mean()) < _NOTICEABLE * size[0]:
        return None
    return picture_motion(motion, size)


class KnockLog:
    """Logs once that a camera has moved, and that it is back."""

    def __init__(self, camera_id: str) -> None:
        self._camera, self._moved = camera_id, False

    def update(self, motion: PictureMotion | None) -> bool:
        """Record the motion now; return whether the camera has begun to be elsewhere."""
        moved = motion is not None
        began = moved and not self._moved
        if motion is not None and began:
            log.warning("camera %s: %s; floor positions are corrected", self._camera, motion_text(motion))
        elif self._moved and not moved:
            log.info("camera %s is where it was", self._camera)
        self._moved = moved
        return began


class ConditionLog:
    """Logs when something else is wrong with a camera's picture, or nothing any more."""

    def __init__(self, camera_id: str) -> None:
        self._camera = camera_id
        self._condition: PictureCondition = "clear"
        self._is_partly_covered = False
        self.since = 0.0
        """When the condition began, unix seconds; 0: nothing is wrong."""

    def update(self, condition: PictureCondition, covered_share: float, began: float) -> None:
        """Record the condition, which began at some unix seconds, and the covered share of the picture."""
        is_partly_covered = condition == "clear" and covered_share > 0.0
        if condition == self._condition and is_partly_covered is self._is_partly_covered:
            return
        if condition != self._condition:
            self.since = 0.0 if condition == "clear" else began
        self._condition, self._is_partly_covered = condition, is_partly_covered
        is_fine = condition == "clear" and not is_partly_covered
        level = logging.INFO if is_fine else logging.WARNING
        log.log(level, "camera %s: %s", self._camera, picture_text(condition, covered_share))
