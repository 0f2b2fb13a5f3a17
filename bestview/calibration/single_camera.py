"""Fit of one camera to the heights of people's boxes, and the priors of cameras and person heights."""

from __future__ import annotations

import numpy as np
import scipy

from bestview.calibration.homography import Floats
from bestview.calibration.pinhole import ASPECT, CAMERA_HEIGHT, FOCAL, PARAMETERS, ROLL, TILT, VIEW, Pinhole
from bestview.calibration.samples import WalkSamples, select_moving_samples
from bestview.calibration.walk_settings import WalkSettings

_OFF_FLOOR_ERROR = 3.0
"""Logarithmic height error of a person above the horizon."""
_MAX_INDEPENDENT_HEIGHTS = 60.0
"""Independent samples that all heights together count as at most: a person's height is constant."""
_TILTS = (0.1, 0.35, 0.8)
_START_HEIGHT = 1.7
_MAX_SAMPLES = 600
_FOCAL_ERROR = 0.01
"""Standard deviation of the logarithm of a given focal length."""


def prior_errors(camera: Pinhole, settings: WalkSettings) -> Floats:
    """Compute the deviations of a camera's parameters from their priors: (4,) standard deviations."""
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
    """Compute robust errors of people's apparent heights: (N,) standard deviations."""
    with np.errstate(invalid="ignore", divide="ignore"):
        log_ratio = np.log(camera.heights(feet) / heights)
    log_ratio = np.where(np.isfinite(log_ratio), log_ratio, _OFF_FLOOR_ERROR) / settings.person_height_spread
    share = weight * min(1.0, _MAX_INDEPENDENT_HEIGHTS / max(float(weight.sum()), 1e-9))
    return np.asarray(robust(log_ratio) * np.sqrt(share))


def robust(errors: Floats) -> Floats:
    """Return Cauchy's robust error: linear where small, logarithmic where large; signs are kept."""
    return np.asarray(np.sign(errors) * np.sqrt(np.log1p(errors * errors)))


def fit_tilt_and_height(
    samples: WalkSamples, size: tuple[int, int], focal: float, settings: WalkSettings
) -> Pinhole:
    """Fit a camera of a given focal length (picture widths) to the heights of people, at the origin.

    On a flat floor the apparent height of people falls linearly to 0 at the horizon, and how fast they grow
    towards the camera gives its height.
    """
    chosen = select_moving_samples(samples, _MAX_SAMPLES)
    feet, tall, weight = samples.feet[chosen], samples.tall[chosen], samples.weight[chosen]
    best, least = None, np.inf
    for tilt in _TILTS:
        start = np.zeros(PARAMETERS)
        start[[FOCAL, TILT, CAMERA_HEIGHT]] = np.log(focal), tilt, np.log(_START_HEIGHT)

        def errors(view: Floats, start: Floats = start) -> Floats:
            camera = Pinhole(np.concatenate([view, start[VIEW.stop :]]), size)
            focal_error = (view[FOCAL] - np.log(focal)) / _FOCAL_ERROR
            heights = height_errors(camera, feet, tall, weight, settings)
            return np.concatenate([heights, prior_errors(camera, settings), [focal_error]])

        solution = scipy.optimize.least_squares(errors, start[VIEW], x_scale="jac", ftol=1e-5, max_nfev=60)
        if solution.cost < least:
            best, least = np.concatenate([solution.x, start[VIEW.stop :]]), solution.cost
    assert best is not None  # noqa: S101 — priors are finite
    return Pinhole(best, size)
