"""Priors of cameras and person heights, as residuals for least squares."""

from __future__ import annotations

import numpy as np

from bestview.calibration.homography import Floats
from bestview.calibration.pinhole import ASPECT, CAMERA_HEIGHT, FOCAL, ROLL, Pinhole
from bestview.calibration.walk_settings import WalkSettings

_OFF_FLOOR_ERROR = 3.0
"""The error, as a logarithm, of the height of somebody who stands above the horizon."""
_MOST_HEIGHTS = 60.0
"""Heights count as this many independent ones at most: tall people are always tall."""


def prior_errors(camera: Pinhole, settings: WalkSettings) -> Floats:
    """Return how unusual a camera is, (4,) standard deviations."""
    parameters = camera.parameters
    return np.array(
        [
            (parameters[FOCAL] - np.log(settings.focal)) / settings.focal_spread,
            parameters[ASPECT] / settings.aspect_spread,
            parameters[ROLL] / settings.roll_spread,
            (parameters[CAMERA_HEIGHT] - np.log(settings.camera_height)) / settings.camera_height_spread,
        ]
    )


def height_errors(
    camera: Pinhole, feet: Floats, heights: Floats, weight: Floats, settings: WalkSettings
) -> Floats:
    """Return robust errors of people's apparent heights, (N,) standard deviations."""
    with np.errstate(invalid="ignore", divide="ignore"):
        log_ratio = np.log(camera.heights(feet) / heights)
    log_ratio = np.where(np.isfinite(log_ratio), log_ratio, _OFF_FLOOR_ERROR) / settings.person_height_spread
    share = weight * min(1.0, _MOST_HEIGHTS / max(float(weight.sum()), 1e-9))
    return np.asarray(robust(log_ratio) * np.sqrt(share))


def robust(errors: Floats) -> Floats:
    """Return Cauchy's robust error: linear where small, logarithmic where large; signs are kept."""
    return np.asarray(np.sign(errors) * np.sqrt(np.log1p(errors * errors)))
