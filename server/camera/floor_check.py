"""A check that a camera's homography puts some of its picture on the floor."""

from __future__ import annotations

import numpy as np

from bestview import shows_ground
from server.config.sections import CameraSettings
from server.system.errors import UserError


def check_floor(camera: CameraSettings, size: tuple[int, int]) -> None:
    """Reject a homography that maps none of the camera's own picture (width, height) to the floor.

    Raises:
        UserError: the whole picture lies above the horizon.
    """
    if camera.ground is not None and not shows_ground(np.array(camera.ground, dtype=np.float64), size):
        raise UserError(
            f"camera {camera.id}: ground: all of its picture, {size[0]}x{size[1]}, lies above the horizon: "
            "its homography is of a camera tilted past straight down, or of another picture; leave it out"
        )
