"""All cameras: which belong together, and one floor for those that do."""

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
from bestview.calibration.walk import Walk
from bestview.calibration.walk_settings import WalkSettings

_ROUNDS = 3


@dataclass(frozen=True, slots=True)
class CameraPair:
    """What was found out about two cameras, by their numbers; no link where nobody was in both at once."""

    one: int
    other: int
    alignment: PairAlignment | None

    def rejection(self, settings: WalkSettings) -> str | None:
        """Say why the two cannot be laid on one floor; None if they can."""
        if self.alignment is None:
            return "nobody was seen walking by both at once"
        return next((words for holds, words in _rejection_reasons(self.alignment, settings) if holds), None)


def _rejection_reasons(it: PairAlignment, settings: WalkSettings) -> Iterator[tuple[bool, str]]:
    """Give what may speak against two cameras' being on one floor, and whether it does."""
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
        rig: where they are; the first is at the origin, its offset 0.
        samples: one for each, taken with the rig's offsets.
        matches: who is one person; cameras are numbered within the group.
    """

    members: tuple[int, ...]
    rig: CameraRig
    samples: tuple[WalkSamples, ...]
    matches: tuple[Correspondences, ...]


def camera_hypotheses(walk: Walk, settings: WalkSettings) -> CameraHypotheses:
    """Give the ways in which a camera may look down: one for a short, a usual and a long focal length."""
    samples = sample_walk(walk, comparison_pulses((walk,), settings), 0.0, settings.step, settings.stride)
    if not len(samples.times):
        return CameraHypotheses(walk, ())
    lengths = settings.focal * np.exp(settings.focal_spread * np.array([-1.0, 0.0, 1.0]))
    return CameraHypotheses(
        walk, tuple(fit_tilt_and_height(samples, walk.size, float(it), settings) for it in lengths)
    )


def align_camera_pairs(walks: Sequence[Walk], settings: WalkSettings) -> list[CameraPair]:
    """Find out about every two cameras."""
    seers = [camera_hypotheses(walk, settings) for walk in walks]
    return [
        CameraPair(a, b, pair_alignment(seers[a], seers[b], settings))
        for a, b in combinations(range(len(walks)), 2)
    ]


def group_cameras(
    walks: Sequence[Walk], pairs: Sequence[CameraPair], settings: WalkSettings
) -> list[CameraGroup]:
    """Lay cameras that belong together on one floor; who belongs to nobody is in no group."""
    good = [it for it in pairs if it.alignment is not None and it.rejection(settings) is None]
    good.sort(key=lambda it: -_merit(it))
    root = list(range(len(walks)))
    tree = []
    for it in good:
        if root[it.one] != root[it.other]:
            tree.append(it)
            gone, kept = max(root[it.one], root[it.other]), min(root[it.one], root[it.other])
            root = [kept if number == gone else number for number in root]
    groups = []
    for first in sorted(set(root)):
        members = tuple(number for number, it in enumerate(root) if it == first)
        if len(members) > 1:
            groups.append(_build_group(walks, members, tree, good, settings))
    return groups


def _merit(pair: CameraPair) -> float:
    return pair.alignment.merit if pair.alignment is not None else 0.0


def _build_group(
    walks: Sequence[Walk],
    members: tuple[int, ...],
    tree: Sequence[CameraPair],
    good: Sequence[CameraPair],
    settings: WalkSettings,
) -> CameraGroup:
    """Chain the tree's links, then move all cameras at once until they agree best."""
    rig = _chain_poses(members, tree)
    pulses = comparison_pulses([walks[number] for number in members], settings)
    numbers = [(members.index(it.one), members.index(it.other)) for it in good if it.one in members]
    samples, matches, sharp = _match_people(walks, members, rig, pulses, numbers, settings)
    for _ in range(_ROUNDS):
        rig = adjust_bundle(
            rig, samples, matches, settings, sharpness=sharp, in_step=settings.maximum_offset == 0
        )
        samples, matches, sharp = _match_people(walks, members, rig, pulses, numbers, settings)
    return CameraGroup(members, rig, tuple(samples), tuple(matches))


def _match_people(
    walks: Sequence[Walk],
    members: Sequence[int],
    rig: CameraRig,
    pulses: np.ndarray,
    numbers: Sequence[tuple[int, int]],
    settings: WalkSettings,
) -> tuple[list[WalkSamples], list[Correspondences], float]:
    """Look who is one person in every two cameras that are linked."""
    samples = [
        sample_walk(walks[number], pulses, float(offset), settings.step, settings.stride)
        for number, offset in zip(members, rig.offsets, strict=True)
    ]
    matches, apart = [], [np.empty((0, 2))]
    for a, b in numbers:
        meeting = candidate_matches(samples[a], samples[b])
        cameras = (rig.cameras[a], rig.cameras[b])
        off, places = compare_samples(cameras, (samples[a], samples[b]), meeting, settings, settings.gate)
        chosen = mutual_matches(off, places, samples[a], samples[b], meeting, settings.gate)
        apart.append(off[chosen])
        matches.append(
            Correspondences(a, b, meeting.here[chosen], meeting.there[chosen], meeting.weight[chosen])
        )
    return samples, matches, estimate_sharpness(np.concatenate(apart))


def _chain_poses(members: tuple[int, ...], tree: Sequence[CameraPair]) -> CameraRig:
    """Put camera after camera on the first one's floor; the best link of each says how it looks down."""
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
            known, new, own, its = (it.one, it.other, 0, 1) if it.one in offsets else (it.other, it.one, 1, 0)
            pose = _pose_relative_to(
                cameras[known], it.alignment.rig.cameras[own], it.alignment.rig.cameras[its]
            )
            parameters = cameras[new].parameters.copy()
            parameters[POSE] = pose
            cameras[new] = replace(cameras[new], parameters=parameters)
            offsets[new] = offsets[known] + float(
                it.alignment.rig.offsets[its] - it.alignment.rig.offsets[own]
            )
    return CameraRig(tuple(cameras[it] for it in members), np.array([offsets[it] for it in members]))


def _pose_relative_to(known: Pinhole, linked: Pinhole, other: Pinhole) -> np.ndarray:
    """Give the pose of the other camera on the floor on which the known one is, from their link, (3,)."""
    turn = known.parameters[PAN] - linked.parameters[PAN]
    cos, sin = np.cos(turn), np.sin(turn)
    away = other.parameters[[EAST, NORTH]] - linked.parameters[[EAST, NORTH]]
    east, north = known.parameters[[EAST, NORTH]] + np.array([[cos, -sin], [sin, cos]]) @ away
    return np.array([other.parameters[PAN] + turn, east, north])
