"""Evidence from the order of tracklets: continued tracks, reappearances, and impossible distances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.association.settings import ResolvedIdentitySettings
from bestview.association.tracklet import Tracklet
from bestview.geometry.ground_plane import foot_points

Floats = NDArray[np.float64]

_IMPOSSIBLE_REACH = 2.0
"""Distance in reaches from which on it cannot be the same person."""


def continuation_evidence(tracklet: Tracklet, settings: ResolvedIdentitySettings) -> float:
    """Compute the evidence that a tracklet is the same person as its predecessor in the track.

    A confirmation by an operator weighs as much as the largest ground evidence against it.
    """
    if tracklet.confirmed_continuation:
        return settings.maximum_ground_evidence
    evidence = settings.continuation_evidence * np.exp(
        -tracklet.crowd_frames_before / settings.continuation_decay_frames
    )
    return float(
        evidence
        if tracklet.frames_since_predecessor <= settings.gap_frames
        else evidence * np.exp(-tracklet.frames_since_predecessor / settings.gap_decay_frames)
    )


@dataclass(frozen=True, slots=True, eq=False)
class EndpointArrays:
    """Start and end of N tracklets as arrays.

    Attributes:
        camera: (N,) number of the camera.
        calibrated: (N,) whether it has a homography.
        first_frame: (N,) frame of the first observation.
        last_frame: (N,) of the last one.
        start: (N, 4) the first box, pixels.
        end: (N, 4) the last one.
        start_ground: (N, 2) the first ground point; NaN: unknown.
        end_ground: (N, 2) the last one.
    """

    camera: NDArray[np.int64]
    calibrated: NDArray[np.bool_]
    first_frame: NDArray[np.int64]
    last_frame: NDArray[np.int64]
    start: Floats
    end: Floats
    start_ground: Floats
    end_ground: Floats

    @classmethod
    def of(
        cls, tracklets: Sequence[Tracklet], camera: NDArray[np.int64], calibrated: NDArray[np.bool_]
    ) -> EndpointArrays:
        """Build the arrays; (N,) `camera` and whether it is `calibrated`."""
        begins, ends = [tracklet.start for tracklet in tracklets], [tracklet.end for tracklet in tracklets]
        return cls(
            camera=camera,
            calibrated=calibrated,
            first_frame=np.array([endpoint.frame for endpoint in begins], dtype=np.int64),
            last_frame=np.array([endpoint.frame for endpoint in ends], dtype=np.int64),
            start=np.array([endpoint.box for endpoint in begins]).reshape(-1, 4),
            end=np.array([endpoint.box for endpoint in ends]).reshape(-1, 4),
            start_ground=np.array([endpoint.ground_point for endpoint in begins]).reshape(-1, 2),
            end_ground=np.array([endpoint.ground_point for endpoint in ends]).reshape(-1, 2),
        )


def reappearance_evidence(
    endpoints: EndpointArrays,
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    settings: ResolvedIdentitySettings,
    height: float,
    walking_speed: float,
) -> tuple[Floats, NDArray[np.bool_]]:
    """Compare where one tracklet of a pair ends with where the other starts shortly afterwards.

    The distance is relative to what a person can walk in that time: on the ground, or in box heights of the
    image if the camera has no homography.

    Args:
        endpoints: of tracklets.
        first: (P,) of them.
        second: (P,) others; their order in time does not matter.
        settings: `reappearance_evidence` and related ones.
        height: of a person in ground units; NaN: unknown.
        walking_speed: largest distance walked in a frame, person heights.

    Returns:
        (P,) evidence of being one person, of pairs in one camera; (P,) too far apart to be one person.
    """
    evidence, too_far = np.zeros(first.size), np.zeros(first.size, dtype=np.bool_)
    in_order = endpoints.first_frame[second] > endpoints.last_frame[first]
    earlier, later = np.where(in_order, first, second), np.where(in_order, second, first)
    gap = endpoints.first_frame[later] - endpoints.last_frame[earlier]
    pair = np.flatnonzero((gap > 0) & (gap <= settings.reappearance_frames))
    earlier, later, gap = earlier[pair], later[pair], gap[pair]
    reach = settings.reappearance_reach_heights + walking_speed * gap
    same_camera = endpoints.camera[earlier] == endpoints.camera[later]
    distance = np.hypot(*(endpoints.end_ground[earlier] - endpoints.start_ground[later]).T) / height
    # A calibrated camera that does not see the feet has no distance: pixels would be no better.
    in_picture = same_camera & ~endpoints.calibrated[earlier]
    distance[in_picture] = _image_distance_in_heights(
        endpoints.end[earlier[in_picture]], endpoints.start[later[in_picture]]
    )
    share = distance / reach
    comparable = ~np.isnan(share)
    base_evidence = np.where(same_camera, settings.reappearance_evidence * np.maximum(1.0 - share, 0.0), 0.0)
    evidence[pair[comparable]] = base_evidence[comparable]
    too_far[pair[comparable]] = share[comparable] > _IMPOSSIBLE_REACH
    return evidence, too_far


def _image_distance_in_heights(first: Floats, second: Floats) -> Floats:
    """Compute the distance between the foot points of (P, 4) boxes in heights of the taller box."""
    height = np.maximum(np.maximum(first[:, 3] - first[:, 1], second[:, 3] - second[:, 1]), 1.0)
    return np.asarray(np.hypot(*(foot_points(first) - foot_points(second)).T) / height)
