"""How far a camera has been moved, as messages and log lines say it."""

from __future__ import annotations

import logging

from server.messaging.camera_status import PictureMotion, motion_text
from tracking.detectors.background.motion import STILL, Motion

log = logging.getLogger(__name__)

_NOTICEABLE = 0.005
"""Motion, as a share of the picture's width, below which floor positions hardly change."""


def noticeable(motion: Motion, size: tuple[int, int]) -> Motion:
    """Return a motion of a picture of ``size`` (width, height), or `STILL` if it is not noticeable."""
    return motion if motion.distance(STILL, size) >= _NOTICEABLE * size[0] else STILL


def motion_message(motion: Motion) -> PictureMotion | None:
    """Return a motion as a message; None: the camera has not moved."""
    if motion == STILL:
        return None
    return PictureMotion(x=motion.x, y=motion.y, grow=motion.grow, turn=motion.turn)


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
