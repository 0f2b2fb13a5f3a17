"""Groups of cameras that share a floor, and their joint calibration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from bestview.calibration.bundle_adjustment import (
    CameraRig,
    Correspondences,
    adjust_bundle,
    estimate_sharpness,
)
from bestview.calibration.camera_pairs import (
    CameraHypotheses,
    PairAlignment,
    compare_samples,
    comparison_pulses,
    pair_alignment,
)
from bestview.calibration.floor_agreement import mutual_matches
from bestview.calibration.pinhole import EAST, NORTH, PAN, POSE, Pinhole
from bestview.calibration.samples import WalkSamples, candidate_matches, sample_walk
from bestview.calibration.single_camera import fit_tilt_and_height
from bestview.calibration.walk_settings import WalkSettings
from bestview.calibration.walk_tracks import Walk

_ROUNDS = 3


@dataclass(frozen=True, slots=True)
class CameraPair:
    """Result of aligning two cameras, by their numbers; no alignment: nobody was in both at the same time."""

    one: int
    other: int
    alignment: PairAlignment | None

    def rejection(self, settings: WalkSettings) -> str | None:
        """Return why the two cannot be placed on one floor; None if they can."""
        if self.alignment is None:
            return "nobody was seen walking by both at once"
        return next(
            (words for applies, words in _rejection_reasons(self.alignment, settings) if applies), None
        )


def _rejection_reasons(it: PairAlignment, settings: WalkSettings) -> Iterator[tuple[bool, str]]:
    """Yield the reasons against placing two cameras on one floor, and whether each applies."""
    few = f"at only {it.places:.0f} steps of the walk people stand in one place"
    needed = f"{settings.minimum_places:.0f} are needed: walk longer where both see"
    yield it.places < settings.minimum_places, f"{few}; {needed}"
    enough = f"{100 * settings.minimum_share:.0f} % are needed"
    share = f"of what both should see they agree about {100 * it.share:.1f} % only; {enough}"
    yield it.share < settings.minimum_share, share
    differs = f"where they have people differs by {it.error:.2f} person heights (median)"
    yield it.error > settings.maximum_error, f"{differs}: are feet hidden, or do people sit?"
    yield it.merit < settings.minimum_over_chance * it.chance, "they agree hardly better than by chance"
    line = "the walk that both saw is a straight line: walk in curves, to and fro and sideways"
    yield it.breadth < settings.minimum_breadth, line


@dataclass(frozen=True, slots=True)
class CameraGroup:
    """Cameras on one floor.

    Attributes:
        members: their numbers, (C,).
        rig: their poses; the first is at the origin, its offset 0.
        samples: one for each, taken with the rig's offsets.
        matches: correspondences; cameras are numbered within the group.
    """

    members: tuple[int, ...]
    rig: CameraRig
    samples: tuple[WalkSamples, ...]
    matches: tuple[Correspondences, ...]


def camera_hypotheses(walk: Walk, settings: WalkSettings) -> CameraHypotheses:
    """Return possible tilts and heights of a camera: one for a short, a usual and a long focal length."""
    samples = sample_walk(walk, comparison_pulses((walk,), settings), 0.0, settings.step, settings.stride)
    if not len(samples.times):
        return CameraHypotheses(walk, ())
    lengths = settings.focal * np.exp(settings.focal_spread * np.array([-1.0, 0.0, 1.0]))
    return CameraHypotheses(
        walk, tuple(fit_tilt_and_height(samples, walk.size, float(it), settings) for it in lengths)
    )


def align_camera_pairs(walks: Sequence[Walk], settings: WalkSettings) -> list[CameraPair]:
    """Align every two cameras."""
    hypotheses = [camera_hypotheses(walk, settings) for walk in walks]
    return [
        CameraPair(a, b, pair_alignment(hypotheses[a], hypotheses[b], settings))
        for a, b in combinations(range(len(walks)), 2)
    ]


def group_cameras(
    walks: Sequence[Walk], pairs: Sequence[CameraPair], settings: WalkSettings
) -> list[CameraGroup]:
    """Group cameras that share a floor and calibrate each group; isolated cameras are in none."""
    accepted = [it for it in pairs if it.alignment is not None and it.rejection(settings) is None]
    accepted.sort(key=lambda it: -_merit(it))
    group_of = list(range(len(walks)))
    tree = []
    for it in accepted:
        if group_of[it.one] != group_of[it.other]:
            tree.append(it)
            removed, remaining = (
                max(group_of[it.one], group_of[it.other]),
                min(group_of[it.one], group_of[it.other]),
            )
            group_of = [remaining if number == removed else number for number in group_of]
    groups = []
    for first in sorted(set(group_of)):
        members = tuple(number for number, it in enumerate(group_of) if it == first)
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
    numbers = [(members.index(it.one), members.index(it.other)) for it in accepted if it.one in members]
    samples, matches, sharpness = _match_people(walks, members, rig, pulses, numbers, settings)
    for _ in range(_ROUNDS):
        rig = adjust_bundle(
            rig, samples, matches, settings, sharpness=sharpness, fixed_offsets=settings.maximum_offset == 0
        )
        samples, matches, sharpness = _match_people(walks, members, rig, pulses, numbers, settings)
    return CameraGroup(members, rig, tuple(samples), tuple(matches))


def _match_people(
    walks: Sequence[Walk],
    members: Sequence[int],
    rig: CameraRig,
    pulses: np.ndarray,
    numbers: Sequence[tuple[int, int]],
    settings: WalkSettings,
) -> tuple[list[WalkSamples], list[Correspondences], float]:
    """Match people between every two aligned cameras."""
    samples = [
        sample_walk(walks[number], pulses, float(offset), settings.step, settings.stride)
        for number, offset in zip(members, rig.offsets, strict=True)
    ]
    matches, residuals = [], [np.empty((0, 2))]
    for a, b in numbers:
        candidates = candidate_matches(samples[a], samples[b])
        cameras = (rig.cameras[a], rig.cameras[b])
        distances, places = compare_samples(
            cameras, (samples[a], samples[b]), candidates, settings, settings.gate
        )
        matched = mutual_matches(distances, places, samples[a], samples[b], candidates, settings.gate)
        residuals.append(distances[matched])
        matches.append(
            Correspondences(
                a, b, candidates.here[matched], candidates.there[matched], candidates.weight[matched]
            )
        )
    return samples, matches, estimate_sharpness(np.concatenate(residuals))


def _chain_poses(members: tuple[int, ...], tree: Sequence[CameraPair]) -> CameraRig:
    """Place the cameras on the first one's floor one by one, each tilted as in its best alignment."""
    cameras: dict[int, Pinhole] = {}
    offsets: dict[int, float] = {members[0]: 0.0}
    for it in tree:  # the best first
        for number, place in ((it.one, 0), (it.other, 1)):
            if number in members and it.alignment is not None:
                cameras.setdefault(number, it.alignment.rig.cameras[place])
    first = cameras[members[0]].parameters.copy()
    first[POSE] = 0.0
    cameras[members[0]] = replace(cameras[members[0]], parameters=first)
    while len(offsets) < len(members):
        for it in tree:
            if it.alignment is None or (it.one in offsets) == (it.other in offsets):
                continue
            known, new, known_index, new_index = (
                (it.one, it.other, 0, 1) if it.one in offsets else (it.other, it.one, 1, 0)
            )
            pose = _pose_relative_to(
                cameras[known], it.alignment.rig.cameras[known_index], it.alignment.rig.cameras[new_index]
            )
            parameters = cameras[new].parameters.copy()
            parameters[POSE] = pose
            cameras[new] = replace(cameras[new], parameters=parameters)
            offsets[new] = offsets[known] + float(
                it.alignment.rig.offsets[new_index] - it.alignment.rig.offsets[known_index]
            )
    return CameraRig(tuple(cameras[it] for it in members), np.array([offsets[it] for it in members]))


def _pose_relative_to(known: Pinhole, linked: Pinhole, other: Pinhole) -> np.ndarray:
    """Return the pose of the other camera on the known one's floor, from their alignment, (3,)."""
    turn = known.parameters[PAN] - linked.parameters[PAN]
    cos, sin = np.cos(turn), np.sin(turn)
    difference = other.parameters[[EAST, NORTH]] - linked.parameters[[EAST, NORTH]]
    east, north = known.parameters[[EAST, NORTH]] + np.array([[cos, -sin], [sin, cos]]) @ difference
    return np.array([other.parameters[PAN] + turn, east, north])
