"""Errors of a calibration: against known cameras, or by people with known identities."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bestview import foot_points, person_heights, to_ground
from bestview.calibration import Walk, WalkCalibration, fit_homography
from bestview.calibration.homography import apply_homography
from tracking.motchallenge import read_rows

Floats = NDArray[np.float64]
_EDGE = 3.0
"""Pixels from the picture's edge within which a box may be cut."""


@dataclass(frozen=True, slots=True)
class GroundAgreement:
    """Distance on the ground between two cameras' foot points of the same person.

    Attributes:
        median: in person heights.
        most: the ninth decile.
        right: share of people whose nearest neighbor in the other camera is the same person.
    """

    median: float
    most: float
    right: float


@dataclass(frozen=True, slots=True)
class CameraOverlap:
    """The people that two cameras show at the same time, by the ground truth.

    Attributes:
        people: that are in both at once at some time.
        boxes: whole boxes of them.
        off: median distance of their foot points from a plane fitted to the nearer half of them, in heights
            of the other camera's boxes; NaN where there are too few, or all on a line.
    """

    people: int
    boxes: int
    off: float


def error_of_known(found: WalkCalibration, truth: Mapping[str, Floats], walks: Sequence[Walk]) -> Floats:
    """Return the errors of all foot points, meters, after the best rotation and shift of the floor."""
    ours, theirs = [], []
    matrices = {camera.camera: camera.homography for camera in found.cameras}
    for walk in walks:
        if walk.camera in matrices:
            image = np.concatenate([foot_points(track.boxes) for track in walk.tracks])
            ours.append(to_ground(matrices[walk.camera], image) @ np.array([1, 1j]))
            theirs.append(to_ground(truth[walk.camera], image) @ np.array([1, 1j]))
    x, y = np.concatenate(ours), np.concatenate(theirs)
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known] - x[known].mean(), y[known] - y[known].mean()
    return np.asarray(np.abs(x * np.exp(1j * np.angle((np.conj(x) * y).sum())) - y), dtype=np.float64)


def agreement(ground: Path, truth: Path, size: tuple[int, int]) -> dict[tuple[str, str], GroundAgreement]:
    """Compare every two cameras of a file of homographies at the boxes of people whom both show."""
    matrices = json.loads(ground.read_text(encoding="utf-8"))["homography"]
    people = {name: _people(path, size) for name in matrices if (path := _file(truth, name)) is not None}
    found = {}
    for one, other in combinations(people, 2):
        both = sorted(people[one].keys() & people[other].keys())
        if both:
            found[one, other] = _of_two(
                np.array(matrices[one]), people[one], np.array(matrices[other]), people[other], both
            )
    return found


def in_common(
    truth: Path, cameras: Sequence[str], size: tuple[int, int]
) -> dict[tuple[str, str], CameraOverlap]:
    """Return for every pair of cameras the people by whom they could be aligned."""
    people = {name: _people(path, size) for name in cameras if (path := _file(truth, name)) is not None}
    found = {}
    for one, other in combinations(people, 2):
        both = sorted(people[one].keys() & people[other].keys())
        here, there = (np.array([people[name][key] for key in both]) for name in (one, other))
        off = _off_plane(here, there) if both else float("nan")
        found[one, other] = CameraOverlap(len({person for _, person in both}), len(both), off)
    return found


def _off_plane(here: Floats, there: Floats) -> float:
    """Fit a plane to the nearer half repeatedly (least trimmed squares), starting with all points."""
    source, target, tall = foot_points(here), foot_points(there), there[:, 3] - there[:, 1]
    kept = np.ones(len(here), dtype=bool)
    median = float("nan")
    for _ in range(_TRIMS):
        try:
            plane = fit_homography(source[kept], target[kept])
        except ValueError:
            return median
        off = np.nan_to_num(np.hypot(*(apply_homography(plane, source) - target).T) / tall, nan=np.inf)
        median = float(np.nanmin([median, np.median(off)]))
        kept = off <= np.median(off)
    return median


_TRIMS = 20

_Boxes = Mapping[tuple[int, int], tuple[float, float, float, float]]
"""By frame and person."""


def _of_two(
    one: Floats, here: _Boxes, other: Floats, there: _Boxes, both: Sequence[tuple[int, int]]
) -> GroundAgreement:
    mine, its = (np.array([boxes[key] for key in both]) for boxes in (here, there))
    tall = float(np.nanmedian(np.concatenate([person_heights(one, mine), person_heights(other, its)])))
    at = to_ground(one, foot_points(mine))
    apart = np.nan_to_num(np.hypot(*(at - to_ground(other, foot_points(its))).T) / tall, nan=np.inf)
    by_frame = defaultdict(list)
    for frame, person in there:
        by_frame[frame].append(person)
    places = dict(zip(there, to_ground(other, foot_points(np.array(list(there.values())))), strict=True))
    right = 0
    for (frame, person), place in zip(both, at, strict=True):
        far = {candidate: np.hypot(*(places[frame, candidate] - place)) for candidate in by_frame[frame]}
        right += min(far, key=lambda candidate: np.nan_to_num(far[candidate], nan=np.inf)) == person
    return GroundAgreement(float(np.median(apart)), float(np.quantile(apart, 0.9)), right / len(both))


def _people(path: Path, size: tuple[int, int]) -> _Boxes:
    """Return the boxes of a file that are not cut by the picture's edges."""
    return {
        (row.frame, row.id): row.box
        for row in read_rows(path)
        if row.confidence != 0.0
        and row.box[0] > _EDGE
        and row.box[2] < size[0] - _EDGE
        and row.box[3] < size[1] - _EDGE
    }


def _file(folder: Path, name: str) -> Path | None:
    return next(
        (path for path in (folder / f"{name}.txt", folder / f"{name}.txt.gz") if path.is_file()), None
    )
