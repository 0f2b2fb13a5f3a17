"""Groups of cameras that share a floor, and their joint calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from bestview.calibration.bundle_adjustment import (
    CameraRig,
    Correspondences,
    adjust_bundle,
    estimate_foot_precision,
)
from bestview.calibration.camera_pairs import align_pair
from bestview.calibration.floor_agreement import mutual_matches
from bestview.calibration.pair_search import (
    CameraHypotheses,
    PairAlignment,
    compare_samples,
    comparison_pulses,
)
from bestview.calibration.pinhole import EAST, NORTH, PAN, POSE, Pinhole
from bestview.calibration.samples import WalkSamples, candidate_matches, sample_walk
from bestview.calibration.single_camera import fit_tilt_and_height
from bestview.calibration.walk_settings import WalkSettings
from bestview.calibration.walk_tracks import Walk

_ROUNDS = 3


@dataclass(frozen=True, slots=True)
class CameraPair:
    """Alignment of two cameras, given by index; None: no person was tracked by both at the same time."""

    one: int
    other: int
    alignment: PairAlignment | None

    def rejection(self, settings: WalkSettings) -> str | None:
        """Return why the two cannot be placed on one floor; None if they can."""
        if self.alignment is None:
            return "no person was tracked by both cameras at the same time"
        return self.alignment.rejection(settings)


@dataclass(frozen=True, slots=True)
class CameraGroup:
    """Cameras on one floor.

    Attributes:
        members: (C,) indices of the walks.
        rig: their poses; the first is at the origin, its offset 0.
        samples: of each camera, with the rig's offsets.
        matches: correspondences; cameras are indices within the group.
    """

    members: tuple[int, ...]
    rig: CameraRig
    samples: tuple[WalkSamples, ...]
    matches: tuple[Correspondences, ...]


def camera_hypotheses(walk: Walk, settings: WalkSettings) -> CameraHypotheses:
    """Return possible tilts and heights of a camera: one for a short, a typical and a long focal length."""
    samples = sample_walk(walk, comparison_pulses((walk,), settings), 0.0, settings.step, settings.stride)
    if not len(samples.times):
        return CameraHypotheses(walk, ())
    lengths = settings.focal * np.exp(settings.focal_spread * np.array([-1.0, 0.0, 1.0]))
    return CameraHypotheses(
        walk, tuple(fit_tilt_and_height(samples, walk.size, float(length), settings) for length in lengths)
    )


def align_camera_pairs(walks: Sequence[Walk], settings: WalkSettings) -> list[CameraPair]:
    """Align all pairs of cameras."""
    hypotheses = [camera_hypotheses(walk, settings) for walk in walks]
    return [
        CameraPair(a, b, align_pair(hypotheses[a], hypotheses[b], settings))
        for a, b in combinations(range(len(walks)), 2)
    ]


def group_cameras(
    walks: Sequence[Walk], pairs: Sequence[CameraPair], settings: WalkSettings
) -> list[CameraGroup]:
    """Group cameras that share a floor and calibrate each group; isolated cameras are in none."""
    accepted = [pair for pair in pairs if pair.alignment is not None and pair.rejection(settings) is None]
    accepted.sort(key=lambda pair: -_merit(pair))
    group_of = list(range(len(walks)))
    tree = []
    for pair in accepted:
        if group_of[pair.one] != group_of[pair.other]:
            tree.append(pair)
            removed, remaining = (
                max(group_of[pair.one], group_of[pair.other]),
                min(group_of[pair.one], group_of[pair.other]),
            )
            group_of = [remaining if number == removed else number for number in group_of]
    groups = []
    for first in sorted(set(group_of)):
        members = tuple(number for number, group in enumerate(group_of) if group == first)
        if len(members) > 1:
            groups.append(_build_group(walks, members, tree, accepted, settings))
    return groups


def _merit(pair: CameraPair) -> float:
    return pair.alignment.merit if pair.alignment is not None else 0.0


def _build_group(
    walks: Sequence[Walk],
    members: tuple[int, ...],
    tree: Sequence[CameraPair],
    accepted: Sequence[CameraPair],
    settings: WalkSettings,
) -> CameraGroup:
    """Chain the alignments of the tree, then adjust all cameras jointly."""
    rig = _chain_poses(members, tree)
    pulses = comparison_pulses([walks[number] for number in members], settings)
    numbers = [
        (members.index(pair.one), members.index(pair.other)) for pair in accepted if pair.one in members
    ]
    samples, matches, foot_precision = _match_people(walks, members, rig, pulses, numbers, settings)
    for _ in range(_ROUNDS):
        rig = adjust_bundle(
            rig,
            samples,
            matches,
            settings,
            foot_precision=foot_precision,
            fixed_offsets=settings.maximum_offset == 0,
        )
        samples, matches, foot_precision = _match_people(walks, members, rig, pulses, numbers, settings)
    return CameraGroup(members, rig, tuple(samples), tuple(matches))


def _match_people(
    walks: Sequence[Walk],
    members: Sequence[int],
    rig: CameraRig,
    pulses: np.ndarray,
    numbers: Sequence[tuple[int, int]],
    settings: WalkSettings,
) -> tuple[list[WalkSamples], list[Correspondences], float]:
    """Match the samples of all aligned pairs of cameras.

    Returns:
        Samples, matches, and the precision of the foot points.
    """
    samples = [
        sample_walk(walks[number], pulses, float(offset), settings.step, settings.stride)
        for number, offset in zip(members, rig.offsets, strict=True)
    ]
    matches, residuals = [], [np.empty((0, 2))]
    for a, b in numbers:
        candidates = candidate_matches(samples[a], samples[b])
        cameras = (rig.cameras[a], rig.cameras[b])
        distances, pair_agreement = compare_samples(
            cameras, (samples[a], samples[b]), candidates, settings, settings.gate
        )
        matched = mutual_matches(distances, pair_agreement, samples[a], samples[b], candidates, settings.gate)
        residuals.append(distances[matched])
        matches.append(
            Correspondences(
                a, b, candidates.here[matched], candidates.there[matched], candidates.weight[matched]
            )
        )
    return samples, matches, estimate_foot_precision(np.concatenate(residuals))


def _chain_poses(members: tuple[int, ...], tree: Sequence[CameraPair]) -> CameraRig:
    """Place the cameras on the first one's floor one by one, each with the tilt of its best alignment."""
    cameras: dict[int, Pinhole] = {}
    offsets: dict[int, float] = {members[0]: 0.0}
    for pair in tree:  # best alignment first
        for number, place in ((pair.one, 0), (pair.other, 1)):
            if number in members and pair.alignment is not None:
                cameras.setdefault(number, pair.alignment.rig.cameras[place])
    first = cameras[members[0]].parameters.copy()
    first[POSE] = 0.0
    cameras[members[0]] = replace(cameras[members[0]], parameters=first)
    while len(offsets) < len(members):
        for pair in tree:
            if pair.alignment is None or (pair.one in offsets) == (pair.other in offsets):
                continue
            known, new, known_index, new_index = (
                (pair.one, pair.other, 0, 1) if pair.one in offsets else (pair.other, pair.one, 1, 0)
            )
            pose = _pose_relative_to(
                cameras[known], pair.alignment.rig.cameras[known_index], pair.alignment.rig.cameras[new_index]
            )
            parameters = cameras[new].parameters.copy()
            parameters[POSE] = pose
            cameras[new] = replace(cameras[new], parameters=parameters)
            offsets[new] = offsets[known] + float(
                pair.alignment.rig.offsets[new_index] - pair.alignment.rig.offsets[known_index]
            )
    return CameraRig(
        tuple(cameras[member] for member in members), np.array([offsets[member] for member in members])
    )


def _pose_relative_to(known: Pinhole, linked: Pinhole, other: Pinhole) -> np.ndarray:
    """Return the pose of `other` on the floor of `known`, from the alignment `linked` to `other`: (3,)."""
    turn = known.parameters[PAN] - linked.parameters[PAN]
    cos, sin = np.cos(turn), np.sin(turn)
    difference = other.parameters[[EAST, NORTH]] - linked.parameters[[EAST, NORTH]]
    east, north = known.parameters[[EAST, NORTH]] + np.array([[cos, -sin], [sin, cos]]) @ difference
    return np.array([other.parameters[PAN] + turn, east, north])
