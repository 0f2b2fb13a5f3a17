"""Samples of a walk at the pulses of comparison, and candidate matches between two cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.calibration.homography import Floats
from bestview.calibration.walk_tracks import Walk
from bestview.geometry.ground_plane import foot_points

Indices = NDArray[np.intp]

LEAST_WEIGHT = 0.02
"""Weight of a sample without movement."""
_WALKING_WEIGHT = 0.3
"""Weight from which a sample counts as walking."""
_MIN_WALKING_SAMPLES = 30


@dataclass(frozen=True, slots=True)
class WalkSamples:
    """One camera's boxes at some pulses.

    Attributes:
        times: (S,) pulse of each, rising within a track.
        track: (S,) index of the track in the walk.
        boxes: (S, 4) left, top, right, bottom in pixels.
        speed: (S, 4) movement of the box per frame, pixels.
        weight: (S,) movement per step in strides, at most 1: standing people add little information.
    """

    times: Floats
    track: Indices
    boxes: Floats
    speed: Floats
    weight: Floats

    @property
    def feet(self) -> Floats:
        """Foot points, (S, 2) pixels."""
        return foot_points(self.boxes)

    @property
    def tall(self) -> Floats:
        """Heights of the boxes, (S,) pixels."""
        return np.asarray(self.boxes[:, 3] - self.boxes[:, 1])


def sample_walk(walk: Walk, pulses: Floats, offset: float, step: int, stride: float) -> WalkSamples:
    """Sample a walk at some pulses.

    Args:
        walk: of one camera.
        pulses: (T,) rising.
        offset: the pulse of the camera's frame 0.
        step: frames over which movement is measured, and between the pulses.
        stride: movement with full weight, box heights.
    """
    times, track, boxes, speed = [np.empty(0)], [np.empty(0, np.intp)], [np.empty((0, 4))], [np.empty((0, 4))]
    for number, walk_track in enumerate(walk.tracks):
        at = pulses[
            np.searchsorted(pulses, walk_track.first_frame + offset) : np.searchsorted(
                pulses, walk_track.end_frame - 1 + offset, "right"
            )
        ]
        before, after = (
            np.clip(at - offset + change, walk_track.first_frame, walk_track.end_frame - 1)
            for change in (-step, step)
        )
        times.append(at)
        track.append(np.full(len(at), number))
        boxes.append(walk_track.at(at - offset))
        speed.append(
            (walk_track.at(after) - walk_track.at(before)) / np.maximum(after - before, 1e-9)[:, None]
        )
    joined = np.concatenate(boxes)
    rate = np.concatenate(speed)
    moved = np.hypot(*foot_points(rate).T) * step / np.maximum(joined[:, 3] - joined[:, 1], 1e-9)
    weight = np.clip(moved / stride, LEAST_WEIGHT, 1.0)
    return WalkSamples(np.concatenate(times), np.concatenate(track), joined, rate, weight)


@dataclass(frozen=True, slots=True)
class CandidateMatches:
    """All pairs of two cameras' samples of one pulse; each may be one person.

    Attributes:
        here: (P,) sample of the first camera.
        there: (P,) sample of the second.
        track_pair: (P,) index of the pair of tracks, 0 to K - 1.
        tracks: (K, 2) the two tracks of each pair.
        weight: (P,) the larger of both samples' weights.
    """

    here: Indices
    there: Indices
    track_pair: Indices
    tracks: Indices
    weight: Floats


def candidate_matches(one: WalkSamples, other: WalkSamples) -> CandidateMatches:
    """Pair every sample of one camera with every sample of the other at the same pulse."""
    order = np.argsort(other.times, kind="stable")
    sorted_times = other.times[order]
    low = np.searchsorted(sorted_times, one.times, "left")
    count = np.searchsorted(sorted_times, one.times, "right") - low
    here = np.repeat(np.arange(len(one.times)), count)
    within = np.arange(len(here)) - np.repeat(np.cumsum(count) - count, count)
    there = order[np.repeat(low, count) + within]
    both = np.column_stack([one.track[here], other.track[there]])
    tracks, track_pair = np.unique(both, axis=0, return_inverse=True)
    weight = np.maximum(one.weight[here], other.weight[there])
    return CandidateMatches(here, there, track_pair.reshape(-1), tracks.reshape(-1, 2), weight)


def select_moving_samples(samples: WalkSamples, maximum: int) -> Indices:
    """Return evenly chosen samples of walking people, (N,) indices; of all people if too few walk."""
    walking = np.flatnonzero(samples.weight >= _WALKING_WEIGHT)
    if len(walking) < _MIN_WALKING_SAMPLES:
        walking = np.arange(len(samples.times))
    return walking[:: max(1, -(-len(walking) // maximum))]
