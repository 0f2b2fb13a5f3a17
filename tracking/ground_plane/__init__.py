"""Joint tracking of everybody on a ground plane that several cameras see, by one network program."""

from tracking.ground_plane.camera import GroundCamera
from tracking.ground_plane.settings import GroundSettings
from tracking.ground_plane.tracker import GroundPlaneTracker, track_ground_plane
from tracking.ground_plane.tracks import GroundBox, GroundFrame, GroundTrack

__all__ = [
    "GroundBox",
    "GroundCamera",
    "GroundFrame",
    "GroundPlaneTracker",
    "GroundSettings",
    "GroundTrack",
    "track_ground_plane",
]
