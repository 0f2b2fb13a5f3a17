"""Search for the alignment of two cameras: their relative pose on one floor, and their time offset."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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
from bestview.calibration.samples import (
    CandidateMatches,
    Indices,
    WalkSamples,
    candidate_matches,
    sample_walk,
)
from bestview.calibration.walk_settings import WalkSettings
from bestview.calibration.walk_tracks import Walk

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
        chance: the merit of an alignment by chance; 0: not computed.
        held_out: share of the agreement in a quarter of the walk that is left with the alignment from the
            other three alone, the least of the four quarters; 1: not computed.
    """

    rig: CameraRig
    places: float
    share: float
    breadth: float
    error: float
    chance: float = 0.0
    held_out: float = 1.0

    @property
    def merit(self) -> float:
        """Score by which alignments are compared."""
        return self.places * self.share

    def rejection(self, settings: WalkSettings) -> str | None:
        """Return why the two cannot be placed on one floor; None if they can."""
        return next((words for applies, words in self._rejection_reasons(settings) if applies), None)

    def _rejection_reasons(self, settings: WalkSettings) -> Iterator[tuple[bool, str]]:
        """Yield the reasons against placing two cameras on one floor, and whether each applies."""
        few = f"the cameras agree at only {self.places:.0f} places of the walk"
        needed = f"{settings.minimum_places:.0f} are needed: walk longer where both see"
        yield self.places < settings.minimum_places, f"{few}; {needed}"
        enough = f"{100 * settings.minimum_share:.0f} % are needed"
        share = f"they agree about only {100 * self.share:.1f} % of what both should see; {enough}"
        yield self.share < settings.minimum_share, share
        differs = f"their positions of the same people differ by {self.error:.2f} person heights (median)"
        yield self.error > settings.maximum_error, f"{differs}: are feet hidden, or do people sit?"
        line = "the walk that both saw is a straight line: walk in curves and in several directions"
        yield self.breadth < settings.minimum_breadth, line
        chance = "they agree little better than by chance"
        yield self.merit < settings.minimum_over_chance * self.chance, chance
        quarter = "in a quarter of the walk they agree about only"
        rest = f"{100 * self.held_out:.0f} % of what they should by the rest: walk longer where both see"
        yield self.held_out < settings.minimum_held_out, f"{quarter} {rest}"


def comparison_pulses(walks: Sequence[Walk], settings: WalkSettings) -> Floats:
    """Return the pulses at which cameras are compared, (T,)."""
    last = max(walk.end_frame for walk in walks)
    return np.arange(
        -settings.maximum_offset, last + settings.maximum_offset + 1, settings.step, dtype=np.float64
    )


def find_best_alignment(
    one: CameraHypotheses, other: CameraHypotheses, pulses: Floats, settings: WalkSettings
) -> PairAlignment | None:
    """Find the alignment of most merit at some pulses; None: no person was tracked by both at one of them."""
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
        _refine_alignment(one.walk, other.walk, _rig(one, other, pose, offset), pulses, settings)
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
    one: Walk, other: Walk, rig: CameraRig, pulses: Floats, settings: WalkSettings
) -> PairAlignment:
    for _ in range(_ROUNDS):
        found = _match_samples(one, other, rig, pulses, settings, settings.gate)
        if len(found.matched) < _MIN_MATCHES:
            break
        rig = adjust_bundle(
            rig,
            (found.here, found.there),
            [Correspondences(0, 1, found.here_index, found.there_index, found.weight)],
            settings,
            foot_precision=estimate_foot_precision(found.distances[found.matched]),
            fixed_offsets=settings.maximum_offset == 0,
        )
    return measure_alignment(one, other, rig, pulses, settings)


@dataclass(frozen=True, slots=True)
class _SampleMatches:
    """The samples of two cameras, which of all candidates are matched, (M,), and how far apart all are."""

    here: WalkSamples
    there: WalkSamples
    candidates: CandidateMatches
    distances: Floats
    pair_agreement: Floats
    matched: Indices

    @property
    def here_index(self) -> Indices:
        """Samples of the first camera that are matched, (M,)."""
        return self.candidates.here[self.matched]

    @property
    def there_index(self) -> Indices:
        """Those of the second that they are matched with, (M,)."""
        return self.candidates.there[self.matched]

    @property
    def weight(self) -> Floats:
        """Weights of the matches, (M,)."""
        return self.candidates.weight[self.matched]


def _match_samples(
    one: Walk, other: Walk, rig: CameraRig, pulses: Floats, settings: WalkSettings, gate: float
) -> _SampleMatches:
    here = sample_walk(one, pulses, 0.0, settings.step, settings.stride)
    there = sample_walk(other, pulses, float(rig.offsets[1]), settings.step, settings.stride)
    candidates = candidate_matches(here, there)
    distances, pair_agreement = compare_samples(rig.cameras, (here, there), candidates, settings, gate)
    matched = mutual_matches(distances, pair_agreement, here, there, candidates, gate)
    return _SampleMatches(here, there, candidates, distances, pair_agreement, matched)


def measure_alignment(
    one: Walk, other: Walk, rig: CameraRig, pulses: Floats, settings: WalkSettings
) -> PairAlignment:
    """Measure how well two cameras agree at some pulses."""
    found = _match_samples(one, other, rig, pulses, settings, settings.final_gate)
    floor = rig.cameras[0].floor(found.here.feet[found.here_index])
    distance = np.hypot(*(floor - rig.cameras[1].floor(found.there.feet[found.there_index])).T)
    return PairAlignment(
        rig,
        total_agreement(found.pair_agreement, found.candidates),
        covisible_agreement(rig.cameras, (found.here, found.there), (found.here_index, found.there_index)),
        walk_breadth(floor, found.weight),
        float(np.median(distance)) if len(distance) else float("inf"),
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
