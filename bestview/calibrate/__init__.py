"""Calibration: homographies to a common floor, from marked points or from people who walk about."""

from bestview.calibrate.homography import Floats, fit_homography
from bestview.calibrate.marked import CalibrationError, MarkedPoints, PointSettings
from bestview.calibrate.points import PointFit, fit_cameras, fit_points
from bestview.calibrate.result import LeftOut, Spread, WalkCalibration, WalkedCamera, calibrate_walks
from bestview.calibrate.walk import Track, Walk, cut_off, make_walk
from bestview.calibrate.walk_settings import WalkSettings

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
