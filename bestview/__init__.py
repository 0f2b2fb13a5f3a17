"""View qualities in, view choices out: the sliding-window DP, identity across cameras, view quality."""

from bestview.association.keys import TrackKey, TrackletKey
from bestview.association.registry.corrections import Merge, Split
from bestview.association.registry.identity_registry import IdentityRegistry, IdentityUpdate
from bestview.association.settings import IdentitySettings
from bestview.association.sightings import AppearanceSample, TrackUpdate
from bestview.evaluation.object_matching import NO_PERSON, match_objects_to_people
from bestview.evaluation.true_views import ViewGroundTruth, optimal_views, view_ground_truth
from bestview.evaluation.view_scores import ViewScore, cut_frames, score_views
from bestview.geometry.box_contact import boxes_touching_others
from bestview.geometry.cross_view import (
    CameraDetections,
    CameraGeometry,
    CrossViewSettings,
    rescore_detections,
    views_overlap,
)
from bestview.geometry.detection_probability import DetectionProbabilityMap
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
from bestview.quality import HIDDEN_COST, QualitySettings, size_quality, view_cost
from bestview.view_selection.dynamic_program import GopCosts
from bestview.view_selection.expected_views import add_inferred_views
from bestview.view_selection.missed_detections import LastDetections, add_missed_detections
from bestview.view_selection.selection import (
    NO_CAMERA,
    NO_VIEW_COST,
    ViewSelection,
    select_views,
    select_views_by_gop,
)
from bestview.view_selection.sparse_costs import VisibleViews

__all__ = [
    "HIDDEN_COST",
    "NO_CAMERA",
    "NO_PERSON",
    "NO_VIEW_COST",
    "AppearanceSample",
    "BodyEstimates",
    "CameraDetections",
    "CameraGeometry",
    "CrossViewSettings",
    "DetectionProbabilityMap",
    "GopCosts",
    "IdentityRegistry",
    "IdentitySettings",
    "IdentityUpdate",
    "LastDetections",
    "Merge",
    "QualitySettings",
    "Split",
    "TrackKey",
    "TrackUpdate",
    "TrackletKey",
    "ViewGroundTruth",
    "ViewScore",
    "ViewSelection",
    "VisibleViews",
    "add_inferred_views",
    "add_missed_detections",
    "boxes_touching_others",
    "camera_height",
    "cut_frames",
    "estimate_bodies",
    "foot_covariance",
    "foot_points",
    "ground_handedness",
    "horizon_row",
    "match_objects_to_people",
    "optimal_views",
    "person_heights",
    "project_boxes",
    "project_feet",
    "rescore_detections",
    "score_views",
    "select_views",
    "select_views_by_gop",
    "shows_ground",
    "size_quality",
    "to_ground",
    "validate_homography",
    "view_cost",
    "view_ground_truth",
    "views_overlap",
]
