"""Calibration: homographies to a common floor, from marked points or from walking people."""

from bestview.calibration.homography import Floats, fit_homography
from bestview.calibration.marked_points import CalibrationError, MarkedPoints, PointSettings
from bestview.calibration.point_calibration import PointFit, agrees_with, fit_cameras, fit_points
from bestview.calibration.walk_calibration import (
    CameraCalibration,
    ErrorSummary,
    UncalibratedCamera,
    WalkCalibration,
    calibrate_from_walks,
)
from bestview.calibration.walk_settings import WalkSettings, comparison_step
from bestview.calibration.walk_tracks import Walk, WalkTrack, boxes_at_edge, build_walk

__all__ = [
    "CalibrationError",
    "CameraCalibration",
    "ErrorSummary",
    "Floats",
    "MarkedPoints",
    "PointFit",
    "PointSettings",
    "UncalibratedCamera",
    "Walk",
    "WalkCalibration",
    "WalkSettings",
    "WalkTrack",
    "agrees_with",
    "boxes_at_edge",
    "build_walk",
    "calibrate_from_walks",
    "comparison_step",
    "fit_cameras",
    "fit_homography",
    "fit_points",
]
