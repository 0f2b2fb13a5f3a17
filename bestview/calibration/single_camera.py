"""Tilt, roll and height of one camera from the heights of people's boxes."""

from __future__ import annotations

import numpy as np
import scipy

from bestview.calibration.homography import Floats
from bestview.calibration.pinhole import CAMERA_HEIGHT, FOCAL, PARAMETERS, TILT, VIEW, Pinhole
from bestview.calibration.priors import height_errors, prior_errors
from bestview.calibration.samples import WalkSamples, select_moving_samples
from bestview.calibration.walk_settings import WalkSettings

_TILTS = (0.1, 0.35, 0.8)
_START_HEIGHT = 1.7
_MOMENTS = 600
_FIXED = 0.01
"""Standard deviation of the focal length where it is given."""


def fit_tilt_and_height(
    samples: WalkSamples, size: tuple[int, int], focal: float, settings: WalkSettings
) -> Pinhole:
    """Fit a camera of a given focal length (picture widths) to the heights of people, at the origin.

    On a flat floor the apparent height of people falls linearly to 0 at the horizon, and how fast they grow
    towards the camera gives its height.
    """
    chosen = select_moving_samples(samples, _MOMENTS)
    feet, tall, weight = samples.feet[chosen], samples.tall[chosen], samples.weight[chosen]
    best, least = None, np.inf
    for tilt in _TILTS:
        start = np.zeros(PARAMETERS)
        start[[FOCAL, TILT, CAMERA_HEIGHT]] = np.log(focal), tilt, np.log(_START_HEIGHT)

        def errors(view: Floats, start: Floats = start) -> Floats:
            camera = Pinhole(np.concatenate([view, start[VIEW.stop :]]), size)
            given = (view[FOCAL] - np.log(focal)) / _FIXED
            heights = height_errors(camera, feet, tall, weight, settings)
            return np.concatenate([heights, prior_errors(camera, settings), [given]])

        found = scipy.optimize.least_squares(errors, start[VIEW], x_scale="jac", ftol=1e-5, max_nfev=60)
        if found.cost < least:
            best, least = np.concatenate([found.x, start[VIEW.stop :]]), found.cost
    assert best is not None  # noqa: S101 — priors are finite
    return Pinhole(best, size)
