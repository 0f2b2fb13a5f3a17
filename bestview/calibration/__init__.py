"""Calibration: homographies to a common floor, from marked points or from people who walk about."""

from bestview.calibration.homography import Floats, fit_homography
from bestview.calibration.marked_points import CalibrationError, MarkedPoints, PointSettings
from bestview.calibration.point_fit import PointFit, fit_cameras, fit_points
from bestview.calibration.walk import Track, Walk, cut_off, make_walk
from bestview.calibration.walk_calibration import (
    LeftOut,
    Spread,
    WalkCalibration,
    WalkedCamera,
    calibrate_walks,
)
from bestview.calibration.walk_settings import WalkSettings

__all__ = [
    "CalibrationError",
    "Floats",
    "LeftOut",
    "MarkedPoints",
    "PointFit",
    "PointSettings",
    "Spread",
    "Track",
    "Walk",
    "WalkCalibration",
    "WalkSettings",
    "WalkedCamera",
    "calibrate_walks",
    "cut_off",
    "fit_cameras",
    "fit_homography",
    "fit_points",
    "make_walk",
]
