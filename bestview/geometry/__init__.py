"""Geometry of calibrated cameras: ground plane, projection between views, and cross-view scoring.

A homography maps pixels of a camera's picture to the ground plane, whose unit is the user's.
"""

from bestview.geometry.box_contact import boxes_touching_others
from bestview.geometry.cross_view import (
    CameraDetections,
    CameraGeometry,
    CrossViewSettings,
    rescore_detections,
    views_overlap,
)
from bestview.geometry.detection_probability import DetectionProbabilityMap
from bestview.geometry.floor_areas import FloorAreas
from bestview.geometry.floor_view import FloorView, overlapping_cameras
from bestview.geometry.ground_plane import (
    camera_height,
    foot_covariance,
    foot_points,
    ground_handedness,
    horizon_row,
    person_heights,
    shows_ground,
    to_ground,
    validate_homography,
)
from bestview.geometry.projected_bodies import BodyEstimates, estimate_bodies, project_boxes, project_feet

__all__ = [
    "BodyEstimates",
    "CameraDetections",
    "CameraGeometry",
    "CrossViewSettings",
    "DetectionProbabilityMap",
    "FloorAreas",
    "FloorView",
    "boxes_touching_others",
    "camera_height",
    "estimate_bodies",
    "foot_covariance",
    "foot_points",
    "ground_handedness",
    "horizon_row",
    "overlapping_cameras",
    "person_heights",
    "project_boxes",
    "project_feet",
    "rescore_detections",
    "shows_ground",
    "to_ground",
    "validate_homography",
    "views_overlap",
]
