"""What is known of cameras and people before their feet are compared, as errors to be made small."""

from __future__ import annotations

import numpy as np

from bestview.calibration.homography import Floats
from bestview.calibration.pinhole import ASPECT, CAMERA_HEIGHT, FOCAL, ROLL, Pinhole
from bestview.calibration.walk_settings import WalkSettings

_OFF_FLOOR_ERROR = 3.0
"""The error, as a logarithm, of the height of somebody who stands above the horizon."""
_MOST_HEIGHTS = 60.0
"""Heights count as this many independent ones at most: who is tall is tall all the time."""


def prior_errors(camera: Pinhole, settings: WalkSettings) -> Floats:
    """How unusual a camera is, (4,) standard deviations."""
    given = camera.parameters
    return np.array(
        [
            (given[FOCAL] - np.log(settings.focal)) / settings.focal_spread,
            given[ASPECT] / settings.aspect_spread,
            given[ROLL] / settings.roll_spread,
            (given[CAMERA_HEIGHT] - np.log(settings.camera_height)) / settings.camera_height_spread,
        ]
    )


def height_errors(
    camera: Pinhole, feet: Floats, tall: Floats, weight: Floats, settings: WalkSettings
) -> Floats:
    """How much taller or smaller people are than the camera says, (N,) standard deviations, robust."""
    with np.errstate(invalid="ignore", divide="ignore"):
        off = np.log(camera.heights(feet) / tall)
    off = np.where(np.isfinite(off), off, _OFF_FLOOR_ERROR) / settings.person_height_spread
    share = weight * min(1.0, _MOST_HEIGHTS / max(float(weight.sum()), 1e-9))
    return np.asarray(robust(off) * np.sqrt(share))


def robust(off: Floats) -> Floats:
    """Cauchy's way to count errors: as they are where small, ever less where large; signs are kept."""
    return np.asarray(np.sign(off) * np.sqrt(np.log1p(off * off)))
