"""What the order of things says: whose track goes on, who is found where they were lost, who is too far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.association.settings import IdentitySettings
from bestview.association.tracklet import Episode
from bestview.geometry.ground_plane import foot_points

Floats = NDArray[np.float64]

_UNSEEN = 25.0
"""Frames unseen after which going on is worth a third."""
_TOO_FAR = 2.0
"""Reaches from which on it is somebody else."""


def goes_on(episode: Episode, settings: IdentitySettings) -> float:
    """Evidence that an episode is the same person as the one before it in its track.

    Somebody's word is worth as much as the ground can say against it.
    """
    if episode.sure:
        return settings.maximum_ground_evidence
    worth = settings.continuation_evidence * np.exp(-episode.crowded / settings.continuation_decay_frames)
    return float(worth if episode.gap <= settings.gap_frames else worth * np.exp(-episode.gap / _UNSEEN))


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Where N episodes begin and end.

    Attributes:
        camera: (N,) number of the camera.
        calibrated: (N,) whether it has a ground.
        first: (N,) frame of the first sighting.
        last: (N,) of the last one.
        begin: (N, 4) the first box, pixels.
        end: (N, 4) the last one.
        begin_ground: (N, 2) the first place on the ground; NaN: unknown.
        end_ground: (N, 2) the last one.
    """

    camera: NDArray[np.int64]
    calibrated: NDArray[np.bool_]
    first: NDArray[np.int64]
    last: NDArray[np.int64]
    begin: Floats
    end: Floats
    begin_ground: Floats
    end_ground: Floats

    @classmethod
    def of(
        cls, episodes: Sequence[Episode], camera: NDArray[np.int64], calibrated: NDArray[np.bool_]
    ) -> Places:
        """Collect them; (N,) `camera` and whether it is `calibrated`."""
        begins, ends = [it.begin for it in episodes], [it.end for it in episodes]
        return cls(
            camera=camera,
            calibrated=calibrated,
            first=np.array([it.frame for it in begins], dtype=np.int64),
            last=np.array([it.frame for it in ends], dtype=np.int64),
            begin=np.array([it.box for it in begins]).reshape(-1, 4),
            end=np.array([it.box for it in ends]).reshape(-1, 4),
            begin_ground=np.array([it.ground for it in begins]).reshape(-1, 2),
            end_ground=np.array([it.ground for it in ends]).reshape(-1, 2),
        )


def lost_and_found(
    places: Places,
    one: NDArray[np.int64],
    two: NDArray[np.int64],
    settings: IdentitySettings,
    height: float,
    pace: float,
) -> tuple[Floats, NDArray[np.bool_]]:
    """Compare where one of a pair ends with where the other one begins a moment later.

    The way between is measured in what somebody can walk in that time: on the ground, or where the camera
    has none in its picture, by box heights.

    Args:
        places: of episodes.
        one: (P,) of them.
        two: (P,) others; which of a pair comes first does not matter.
        settings: `found` and what belongs to it.
        height: of a person in ground units; NaN: not known yet.
        pace: how far somebody can walk in a frame, in heights.

    Returns:
        (P,) evidence of being one person, of pairs in one camera; (P,) too far.
    """
    evidence, too_far = np.zeros(one.size), np.zeros(one.size, dtype=np.bool_)
    later = places.first[two] > places.last[one]
    lost, found = np.where(later, one, two), np.where(later, two, one)
    gap = places.first[found] - places.last[lost]
    pair = np.flatnonzero((gap > 0) & (gap <= settings.reappearance_frames))
    lost, found, gap = lost[pair], found[pair], gap[pair]
    reach = settings.reappearance_reach_heights + pace * gap
    same_camera = places.camera[lost] == places.camera[found]
    apart = np.hypot(*(places.end_ground[lost] - places.begin_ground[found]).T) / height
    # A camera that has a ground but does not see the feet knows nothing: pixels would not tell better.
    in_picture = same_camera & ~places.calibrated[lost]
    apart[in_picture] = _picture_heights(places.end[lost[in_picture]], places.begin[found[in_picture]])
    share = apart / reach
    known = ~np.isnan(share)
    worth = np.where(same_camera, settings.reappearance_evidence * np.maximum(1.0 - share, 0.0), 0.0)
    evidence[pair[known]] = worth[known]
    too_far[pair[known]] = share[known] > _TOO_FAR
    return evidence, too_far


def _picture_heights(one: Floats, two: Floats) -> Floats:
    """Distance between the feet of (P, 4) boxes in heights of the taller one."""
    tall = np.maximum(np.maximum(one[:, 3] - one[:, 1], two[:, 3] - two[:, 1]), 1.0)
    return np.asarray(np.hypot(*(foot_points(one) - foot_points(two)).T) / tall)
