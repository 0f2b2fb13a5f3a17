"""Alignment of two cameras: whether they see one floor, their relative pose on it, and their time offset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bestview.calibration.bundle_adjustment import (
    CameraRig,
    Correspondences,
    adjust_bundle,
    estimate_foot_precision,
)
from bestview.calibration.floor_agreement import (
    covisible_agreement,
    mutual_matches,
    project_to_floor,
    select_positions,
    total_agreement,
    track_pair_agreement,
    whitened_differences,
)
from bestview.calibration.homography import Floats
from bestview.calibration.pair_hypotheses import RelativePose, propose_relative_poses
from bestview.calibration.pinhole import EAST, NORTH, PAN, Pinhole
from bestview.calibration.samples import CandidateMatches, WalkSamples, candidate_matches, sample_walk
from bestview.calibration.walk_settings import WalkSettings
from bestview.calibration.walk_tracks import Walk, halves_swapped, time_reversed

_MAX_HYPOTHESES = 60
"""Poses tried for each offset."""
_MAX_REFINED = 3
"""Best poses that are refined."""
_MIN_MATCHES = 8
"""Matches below which an alignment is not refined."""
_ROUNDS = 3
_OFFSET_STEPS = 2
"""Offsets are tried this many times `step` apart; refinement covers those in between."""
_MAX_CANDIDATES = 20_000
"""Candidate matches beyond which pulses are left out."""


@dataclass(frozen=True, slots=True)
class CameraHypotheses:
    """A camera's walk, and its possible poses over the floor."""

    walk: Walk
    poses: tuple[Pinhole, ...]


@dataclass(frozen=True, slots=True)
class PairAlignment:
    """Alignment of two cameras that may be on one floor.

    Attributes:
        rig: both of them; the first is at the origin, its offset 0.
        places: number of places at which both have the same person.
        share: matched share of the samples that both cameras could see.
        breadth: standard deviation of the common walk across its main direction, person heights.
        error: median distance between both cameras' positions of a person, person heights.
        chance: the merit of an alignment by chance.
    """

    rig: CameraRig
    places: float
    share: float
    breadth: float
    error: float
    chance: float = 0.0

    @property
    def merit(self) -> float:
        """Score by which alignments are compared."""
        return self.places * self.share


def align_pair(
    one: CameraHypotheses, other: CameraHypotheses, settings: WalkSettings
) -> PairAlignment | None:
    """Align two cameras; None: they have no samples of the same pulse."""
    best = _best_alignment(one, other, settings)
    if best is None:
        return None
    by_chance = [
        _best_alignment(one, replace(other, walk=walk), settings)
        for walk in (time_reversed(other.walk), halves_swapped(other.walk))
    ]
    return replace(
        best, chance=max((alignment.merit for alignment in by_chance if alignment is not None), default=0.0)
    )


def comparison_pulses(walks: Sequence[Walk], settings: WalkSettings) -> Floats:
    """Return the pulses at which cameras are compared, (T,)."""
    last = max(walk.end_frame for walk in walks)
    return np.arange(
        -settings.maximum_offset, last + settings.maximum_offset + 1, settings.step, dtype=np.float64
    )


def _best_alignment(
    one: CameraHypotheses, other: CameraHypotheses, settings: WalkSettings
) -> PairAlignment | None:
    pulses = comparison_pulses((one.walk, other.walk), settings)
    here = sample_walk(one.walk, pulses, 0.0, settings.step, settings.stride)
    trials: list[tuple[float, float, RelativePose]] = []
    interval = settings.step * _OFFSET_STEPS
    steps = settings.maximum_offset // interval
    for offset in range(-steps * interval, steps * interval + 1, interval):
        there = sample_walk(other.walk, pulses, float(offset), settings.step, settings.stride)
        candidates = candidate_matches(here, there)
        if len(candidates.here) > _MAX_CANDIDATES:
            kept_pulses = pulses[:: -(-len(candidates.here) // _MAX_CANDIDATES)]
            candidates = _subset(candidates, np.isin(here.times[candidates.here], kept_pulses))
        trials += [
            (places, float(offset), pose)
            for places, pose in _score_poses(one, here, other, there, candidates, settings)
        ]
    trials.sort(key=lambda trial: (-trial[0], abs(trial[1])))
    alignments = [
        _refine_alignment(one, here, other, pulses, offset, pose, settings)
        for _, offset, pose in trials[:_MAX_REFINED]
    ]
    return max(alignments, key=lambda alignment: alignment.merit, default=None)


def _subset(candidates: CandidateMatches, chosen: np.ndarray) -> CandidateMatches:
    some = np.flatnonzero(chosen)
    numbers, track_pair = np.unique(candidates.track_pair[some], return_inverse=True)
    scale = len(candidates.here) / max(1, len(some))
    return CandidateMatches(
        candidates.here[some],
        candidates.there[some],
        track_pair.reshape(-1),
        candidates.tracks[numbers],
        candidates.weight[some] * scale,
    )


def _score_poses(
    one: CameraHypotheses,
    here: WalkSamples,
    other: CameraHypotheses,
    there: WalkSamples,
    candidates: CandidateMatches,
    settings: WalkSettings,
) -> list[tuple[float, RelativePose]]:
    """Return the poses with the most places at which the cameras agree, and their number, best first."""
    positions = [project_to_floor(view, here.feet, here.tall, settings) for view in one.poses]
    other_positions = [project_to_floor(view, there.feet, there.tall, settings) for view in other.poses]
    scored = []
    for pose in propose_relative_poses(positions, other_positions, candidates, _MAX_HYPOTHESES):
        transformed = positions[pose.here].transformed(pose.rotation, pose.translation)
        distances = whitened_differences(
            select_positions(transformed, candidates.here),
            select_positions(other_positions[pose.there], candidates.there),
            settings,
        )
        scored.append(
            (total_agreement(track_pair_agreement(distances, candidates, settings.gate), candidates), pose)
        )
    scored.sort(key=lambda entry: -entry[0])
    return scored[:_MAX_REFINED]


def _rig(one: CameraHypotheses, other: CameraHypotheses, pose: RelativePose, offset: float) -> CameraRig:
    """Place the first camera at the origin and the other by the relative pose."""
    first, second = one.poses[pose.here], other.poses[pose.there]
    # The pose maps the first camera's floor onto the second's: invert it for the second camera.
    cos, sin = np.cos(-pose.rotation), np.sin(-pose.rotation)
    parameters = second.parameters.copy()
    parameters[PAN] -= pose.rotation
    parameters[[EAST, NORTH]] = -np.array([[cos, -sin], [sin, cos]]) @ pose.translation
    return CameraRig((first, replace(second, parameters=parameters)), np.array([0.0, offset]))


def _refine_alignment(
    one: CameraHypotheses,
    here: WalkSamples,
    other: CameraHypotheses,
    pulses: Floats,
    offset: float,
    pose: RelativePose,
    settings: WalkSettings,
) -> PairAlignment:
    rig = _rig(one, other, pose, offset)
    for gate in (*([settings.gate] * _ROUNDS), settings.final_gate):
        there = sample_walk(other.walk, pulses, float(rig.offsets[1]), settings.step, settings.stride)
        candidates = candidate_matches(here, there)
        distances, pair_agreement = compare_samples(rig.cameras, (here, there), candidates, settings, gate)
        matched = mutual_matches(distances, pair_agreement, here, there, candidates, gate)
        if gate == settings.final_gate or len(matched) < _MIN_MATCHES:
            break
        matches = Correspondences(
            0, 1, candidates.here[matched], candidates.there[matched], candidates.weight[matched]
        )
        rig = adjust_bundle(
            rig,
            (here, there),
            [matches],
            settings,
            foot_precision=estimate_foot_precision(distances[matched]),
            fixed_offsets=settings.maximum_offset == 0,
        )
    floor = rig.cameras[0].floor(here.feet[candidates.here[matched]])
    distance = np.hypot(*(floor - rig.cameras[1].floor(there.feet[candidates.there[matched]])).T)
    error = float(np.median(distance)) if len(distance) else float("inf")
    share = covisible_agreement(
        rig.cameras, (here, there), (candidates.here[matched], candidates.there[matched])
    )
    return PairAlignment(
        rig,
        total_agreement(pair_agreement, candidates),
        share,
        walk_breadth(floor, candidates.weight[matched]),
        error,
    )


def compare_samples(
    cameras: Sequence[Pinhole],
    samples: Sequence[WalkSamples],
    candidates: CandidateMatches,
    settings: WalkSettings,
    gate: float,
) -> tuple[Floats, Floats]:
    """Compute whitened distances of all candidates, (P, 2), and the agreement of pairs of tracks, (K,)."""
    first, second = (
        project_to_floor(camera, camera_samples.feet, camera_samples.tall, settings)
        for camera, camera_samples in zip(cameras, samples, strict=True)
    )
    distances = whitened_differences(
        select_positions(first, candidates.here), select_positions(second, candidates.there), settings
    )
    return distances, track_pair_agreement(distances, candidates, gate)


def walk_breadth(floor: Floats, weight: Floats) -> float:
    """Return the standard deviation of places (N, 2) across their main direction."""
    if not weight.sum() > 0:
        return 0.0
    middle = np.average(floor, axis=0, weights=weight)
    centered = (floor - middle) * np.sqrt(weight / weight.sum())[:, None]
    return float(np.linalg.svd(centered, compute_uv=False)[-1])
