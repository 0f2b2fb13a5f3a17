"""Two cameras: whether they see one floor, how they stand to each other on it, and how far out of step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bestview.calibration.bundle_adjustment import (
    CameraRig,
    Correspondences,
    adjust_bundle,
    estimate_sharpness,
)
from bestview.calibration.chance_agreement import halves_swapped, time_reversed
from bestview.calibration.covisibility import covisible_agreement
from bestview.calibration.floor_agreement import (
    mutual_matches,
    pair_agreement,
    project_to_floor,
    select_positions,
    total_agreement,
    whitened_differences,
)
from bestview.calibration.homography import Floats
from bestview.calibration.pair_hypotheses import RelativePose, propose_relative_poses
from bestview.calibration.pinhole import EAST, NORTH, PAN, Pinhole
from bestview.calibration.samples import CandidateMatches, WalkSamples, candidate_matches, sample_walk
from bestview.calibration.walk import Walk
from bestview.calibration.walk_settings import WalkSettings

_GUESSES = 60
"""Guesses looked at for each offset that is tried."""
_REFINED = 3
"""Guesses that are refined, the best ones ..."""
_NEARLY = 0.7
"""... as far as they are this share as good as the very best."""
_ROUNDS = 3
_OFFSET_STEPS = 2
"""Offsets are tried this many times `step` apart; between them they are refined."""
_MOST_MEETINGS = 20_000
"""Of more, moments are left out."""


@dataclass(frozen=True, slots=True)
class CameraHypotheses:
    """A camera: what it saw, and how it may look down on the floor."""

    walk: Walk
    poses: tuple[Pinhole, ...]


@dataclass(frozen=True, slots=True)
class PairAlignment:
    """Two cameras on one floor, perhaps.

    Attributes:
        rig: both of them; the first is at the origin, its offset 0.
        places: at how many places they agree about who stands there.
        share: about what share that is of all that both could see.
        error: how far apart they have the same people, person heights (median).
        chance: what places times share would be by chance.
        walk_breadth: how broad the walk is that both saw: standard deviation across its main direction,
            person heights.
    """

    rig: CameraRig
    places: float
    share: float
    breadth: float
    error: float
    chance: float = 0.0

    @property
    def merit(self) -> float:
        """What links are compared by."""
        return self.places * self.share


def pair_alignment(
    one: CameraHypotheses, other: CameraHypotheses, settings: WalkSettings
) -> PairAlignment | None:
    """Find out how two cameras stand to each other; None where nobody walked in both at once."""
    best = _best_alignment(one, other, settings)
    if best is None:
        return None
    wrong = [
        _best_alignment(one, replace(other, walk=it), settings)
        for it in (time_reversed(other.walk), halves_swapped(other.walk))
    ]
    return replace(best, chance=max((it.merit for it in wrong if it is not None), default=0.0))


def comparison_pulses(walks: Sequence[Walk], settings: WalkSettings) -> Floats:
    """Give the moments at which cameras are compared, (T,)."""
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
    apart_by = settings.step * _OFFSET_STEPS
    steps = settings.maximum_offset // apart_by
    for offset in range(-steps * apart_by, steps * apart_by + 1, apart_by):
        there = sample_walk(other.walk, pulses, float(offset), settings.step, settings.stride)
        meeting = candidate_matches(here, there)
        if len(meeting.here) > _MOST_MEETINGS:
            fewer = pulses[:: -(-len(meeting.here) // _MOST_MEETINGS)]
            meeting = _within(meeting, np.isin(here.times[meeting.here], fewer))
        trials += [
            (places, float(offset), it)
            for places, it in _score_poses(one, here, other, there, meeting, settings)
        ]
    trials.sort(key=lambda it: (-it[0], abs(it[1])))
    found = [
        _refine_alignment(one, here, other, pulses, offset, guess, settings)
        for _, offset, guess in trials[:_REFINED]
    ]
    return max(found, key=lambda it: it.merit, default=None)


def _within(meeting: CandidateMatches, chosen: np.ndarray) -> CandidateMatches:
    some = np.flatnonzero(chosen)
    numbers, pair = np.unique(meeting.pair[some], return_inverse=True)
    scale = len(meeting.here) / max(1, len(some))
    return CandidateMatches(
        meeting.here[some],
        meeting.there[some],
        pair.reshape(-1),
        meeting.tracks[numbers],
        meeting.weight[some] * scale,
    )


def _score_poses(
    one: CameraHypotheses,
    here: WalkSamples,
    other: CameraHypotheses,
    there: WalkSamples,
    meeting: CandidateMatches,
    settings: WalkSettings,
) -> list[tuple[float, RelativePose]]:
    """Give guesses with the places at which the cameras then agree, best first."""
    first = [project_to_floor(view, here.feet, here.tall, settings) for view in one.poses]
    second = [project_to_floor(view, there.feet, there.tall, settings) for view in other.poses]
    found = []
    for guess in propose_relative_poses(first, second, meeting, _GUESSES):
        moved = first[guess.here].transformed(guess.turn, guess.maximum_offset)
        off = whitened_differences(
            select_positions(moved, meeting.here),
            select_positions(second[guess.there], meeting.there),
            settings,
        )
        found.append((total_agreement(pair_agreement(off, meeting, settings.gate), meeting), guess))
    found.sort(key=lambda it: -it[0])
    return found[:_REFINED]


def _rig(one: CameraHypotheses, other: CameraHypotheses, guess: RelativePose, offset: float) -> CameraRig:
    """Put the first camera at the origin and the other where the guess has it."""
    first, second = one.poses[guess.here], other.poses[guess.there]
    # The guess turns and shifts the first one's floor onto the second's; undo it for the second.
    cos, sin = np.cos(-guess.turn), np.sin(-guess.turn)
    parameters = second.parameters.copy()
    parameters[PAN] -= guess.turn
    parameters[[EAST, NORTH]] = -np.array([[cos, -sin], [sin, cos]]) @ guess.maximum_offset
    return CameraRig((first, replace(second, parameters=parameters)), np.array([0.0, offset]))


def _refine_alignment(
    one: CameraHypotheses,
    here: WalkSamples,
    other: CameraHypotheses,
    pulses: Floats,
    offset: float,
    guess: RelativePose,
    settings: WalkSettings,
) -> PairAlignment:
    rig = _rig(one, other, guess, offset)
    for gate in (*([settings.gate] * _ROUNDS), settings.final_gate):
        there = sample_walk(other.walk, pulses, float(rig.offsets[1]), settings.step, settings.stride)
        meeting = candidate_matches(here, there)
        off, places = compare_samples(rig.cameras, (here, there), meeting, settings, gate)
        chosen = mutual_matches(off, places, here, there, meeting, gate)
        if gate == settings.final_gate or len(chosen) < _LEAST_MATCHES:
            break
        matches = Correspondences(0, 1, meeting.here[chosen], meeting.there[chosen], meeting.weight[chosen])
        rig = adjust_bundle(
            rig,
            (here, there),
            [matches],
            settings,
            sharpness=estimate_sharpness(off[chosen]),
            in_step=settings.maximum_offset == 0,
        )
    floor = rig.cameras[0].floor(here.feet[meeting.here[chosen]])
    away = np.hypot(*(floor - rig.cameras[1].floor(there.feet[meeting.there[chosen]])).T)
    error = float(np.median(away)) if len(away) else float("inf")
    share = covisible_agreement(rig.cameras, (here, there), (meeting.here[chosen], meeting.there[chosen]))
    return PairAlignment(
        rig, total_agreement(places, meeting), share, walk_breadth(floor, meeting.weight[chosen]), error
    )


_LEAST_MATCHES = 8


def compare_samples(
    cameras: Sequence[Pinhole],
    samples: Sequence[WalkSamples],
    meeting: CandidateMatches,
    settings: WalkSettings,
    gate: float,
) -> tuple[Floats, Floats]:
    """Give how far apart all meetings are, whitened (P, 2), and where pairs of tracks agree, (K,)."""
    first, second = (
        project_to_floor(camera, it.feet, it.tall, settings)
        for camera, it in zip(cameras, samples, strict=True)
    )
    off = whitened_differences(
        select_positions(first, meeting.here), select_positions(second, meeting.there), settings
    )
    return off, pair_agreement(off, meeting, gate)


def walk_breadth(floor: Floats, weight: Floats) -> float:
    """The standard deviation of places (N, 2) across their main direction."""
    if not weight.sum() > 0:
        return 0.0
    middle = np.average(floor, axis=0, weights=weight)
    away = (floor - middle) * np.sqrt(weight / weight.sum())[:, None]
    return float(np.linalg.svd(away, compute_uv=False)[-1])
