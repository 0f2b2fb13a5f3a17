"""View qualities in, view choices out: the sliding-window DP, identity across cameras, view quality."""

from bestview.choice import NO_CAMERA, NO_VIEW_COST, Choices, choose_views
from bestview.evidence import TrackKey
from bestview.ground import checked_homography, feet, foot_spread, person_heights, to_ground
from bestview.identity import IdentityRegistry, IdentityUpdate
from bestview.identity_settings import IdentitySettings
from bestview.people import Merge
from bestview.quality import HIDDEN_COST, size_quality, view_cost
from bestview.score import ViewScore, score_views
from bestview.sightings import LocalTrack

__all__ = [
    "HIDDEN_COST",
    "NO_CAMERA",
    "NO_VIEW_COST",
    "Choices",
    "IdentityRegistry",
    "IdentitySettings",
    "IdentityUpdate",
    "LocalTrack",
    "Merge",
    "TrackKey",
    "ViewScore",
    "checked_homography",
    "choose_views",
    "feet",
    "foot_spread",
    "person_heights",
    "score_views",
    "size_quality",
    "to_ground",
    "view_cost",
]
