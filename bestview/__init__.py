"""View qualities in, view choices out: the sliding-window DP, identity across cameras, view quality."""

from bestview.choice import NO_CAMERA, NO_VIEW_COST, Choices, choose_by_gops, choose_views
from bestview.choice_expected import with_expected
from bestview.choice_missed import LastSeen, with_missed
from bestview.choice_program import Gops
from bestview.choice_seen import SeenViews
from bestview.corrections import Merge, Split
from bestview.elsewhere import Bodies, bodies, boxes_seen, feet_seen
from bestview.findable import Findable
from bestview.ground import (
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
from bestview.identity import IdentityRegistry, IdentityUpdate
from bestview.identity_settings import IdentitySettings
from bestview.keys import EpisodeKey, TrackKey
from bestview.quality import HIDDEN_COST, QualitySettings, size_quality, view_cost
from bestview.score import ViewScore, cuts_of, score_views
from bestview.score_objects import NOBODY, stands_for
from bestview.score_truth import ViewTruth, best_views, true_views
from bestview.sightings import Glimpse, LocalTrack
from bestview.touching import touching
from bestview.witness import Findings, Vantage, WitnessSettings, overlook, witnessed

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
