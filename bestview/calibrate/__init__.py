"""Calibration: homographies to a common floor, from marked points or from people who walk about."""

from bestview.calibrate.homography import Floats, fit_homography
from bestview.calibrate.points import (
    CalibrationError,
    MarkedPoints,
    PointFit,
    PointSettings,
    fit_cameras,
    fit_points,
)

__all__ = [
    "CalibrationError",
    "Floats",
    "MarkedPoints",
    "PointFit",
    "PointSettings",
    "fit_cameras",
    "fit_homography",
    "fit_points",
]
