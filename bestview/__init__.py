"""View qualities in, view choices out: the sliding-window DP, identity across cameras, view quality."""

from bestview.association.keys import EpisodeKey, TrackKey
from bestview.association.registry.corrections import Merge, Split
from bestview.association.registry.identity_registry import IdentityRegistry, IdentityUpdate
from bestview.association.settings import IdentitySettings
from bestview.association.sightings import Glimpse, LocalTrack
from bestview.evaluation.object_matching import NOBODY, stands_for
from bestview.evaluation.true_views import ViewTruth, best_views, true_views
from bestview.evaluation.view_scores import ViewScore, cuts_of, score_views
from bestview.geometry.box_contact import touching
from bestview.geometry.cross_view import Findings, Vantage, WitnessSettings, overlook, witnessed
from bestview.geometry.detection_probability import Findable
from bestview.geometry.ground_plane import (
    camera_height,
    checked_homography,
    feet,
    foot_spread,
    horizon,
    person_heights,
    shows_floor,
    to_ground,
    turns,
)
from bestview.geometry.projected_bodies import Bodies, bodies, boxes_seen, feet_seen
from bestview.quality import HIDDEN_COST, QualitySettings, size_quality, view_cost
from bestview.view_selection.dynamic_program import Gops
from bestview.view_selection.expected_views import with_expected
from bestview.view_selection.missed_detections import LastSeen, with_missed
from bestview.view_selection.selection import NO_CAMERA, NO_VIEW_COST, Choices, choose_by_gops, choose_views
from bestview.view_selection.sparse_costs import SeenViews

__all__ = [
    "HIDDEN_COST",
    "NOBODY",
    "NO_CAMERA",
    "NO_VIEW_COST",
    "Bodies",
    "Choices",
    "EpisodeKey",
    "Findable",
    "Findings",
    "Glimpse",
    "Gops",
    "IdentityRegistry",
    "IdentitySettings",
    "IdentityUpdate",
    "LastSeen",
    "LocalTrack",
    "Merge",
    "QualitySettings",
    "SeenViews",
    "Split",
    "TrackKey",
    "Vantage",
    "ViewScore",
    "ViewTruth",
    "WitnessSettings",
    "best_views",
    "bodies",
    "boxes_seen",
    "camera_height",
    "checked_homography",
    "choose_by_gops",
    "choose_views",
    "cuts_of",
    "feet",
    "feet_seen",
    "foot_spread",
    "horizon",
    "overlook",
    "person_heights",
    "score_views",
    "shows_floor",
    "size_quality",
    "stands_for",
    "to_ground",
    "touching",
    "true_views",
    "turns",
    "view_cost",
    "with_expected",
    "with_missed",
    "witnessed",
]
