"""Errors of a calibration, against the true cameras or between foot points of the same people."""

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
"""Pixels from the picture's edge within which a box may be truncated."""


@dataclass(frozen=True, slots=True)
class GroundAgreement:
    """Distance on the ground between two cameras' foot points of the same person.

    Attributes:
        median: in person heights.
        p90: the 90th percentile, in person heights.
        nearest_correct: share of people whose nearest neighbor in the other camera is the same person.
    """

    median: float
    p90: float
    nearest_correct: float


@dataclass(frozen=True, slots=True)
class CameraOverlap:
    """The people that two cameras show at the same time, by the ground truth.

    Attributes:
        people: number of people that both show in the same frame.
        boxes: number of their untruncated boxes.
        residual: least median distance of their foot points from a plane, in heights of the other camera's
            boxes; NaN if there are too few, or all are on a line.
    """

    people: int
    boxes: int
    residual: float


def foot_point_errors(found: WalkCalibration, truth: Mapping[str, Floats], walks: Sequence[Walk]) -> Floats:
    """Return the errors of all foot points, meters, after the best rotation and shift of the floor."""
    estimated, true = [], []
    matrices = {camera.camera: camera.homography for camera in found.cameras}
    for walk in walks:
        if walk.camera in matrices:
            image = np.concatenate([foot_points(track.boxes) for track in walk.tracks])
            estimated.append(to_ground(matrices[walk.camera], image) @ np.array([1, 1j]))
            true.append(to_ground(truth[walk.camera], image) @ np.array([1, 1j]))
    x, y = np.concatenate(estimated), np.concatenate(true)
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known] - x[known].mean(), y[known] - y[known].mean()
    return np.asarray(np.abs(x * np.exp(1j * np.angle((np.conj(x) * y).sum())) - y), dtype=np.float64)


def ground_agreements(
    ground: Path, truth: Path, size: tuple[int, int]
) -> dict[tuple[str, str], GroundAgreement]:
    """Compare each pair of cameras of a file of homographies by the boxes of people visible in both."""
    matrices = json.loads(ground.read_text(encoding="utf-8"))["homography"]
    people = {name: _people(path, size) for name in matrices if (path := _file(truth, name)) is not None}
    found = {}
    for one, other in combinations(people, 2):
        both = sorted(people[one].keys() & people[other].keys())
        if both:
            found[one, other] = _compare_pair(
                np.array(matrices[one]), people[one], np.array(matrices[other]), people[other], both
            )
    return found


def camera_overlaps(
    truth: Path, cameras: Sequence[str], size: tuple[int, int]
) -> dict[tuple[str, str], CameraOverlap]:
    """Return for each pair of cameras the people by which they can be aligned."""
    people = {name: _people(path, size) for name in cameras if (path := _file(truth, name)) is not None}
    found = {}
    for one, other in combinations(people, 2):
        both = sorted(people[one].keys() & people[other].keys())
        here, there = (np.array([people[name][key] for key in both]) for name in (one, other))
        residual = _plane_residual(here, there) if both else float("nan")
        found[one, other] = CameraOverlap(len({person for _, person in both}), len(both), residual)
    return found


def _plane_residual(here: Floats, there: Floats) -> float:
    """Return the least median distance from a plane (least median of squares: Rousseeuw, 1984).

    The plane through all points, and the best of those through four random ones, are fitted repeatedly to
    the nearer half. From the first alone the fit ends elsewhere if many people sit and their feet are hidden.
    """
    source, target, heights = foot_points(here), foot_points(there), there[:, 3] - there[:, 1]
    if len(source) < _CORNERS:
        return float("nan")
    random = np.random.default_rng(0)
    sampled = min(
        (
            _plane_distances(source, target, heights, random.choice(len(source), _CORNERS, replace=False))
            for _ in range(_SAMPLES)
        ),
        key=np.median,
    )
    least = np.inf
    for start in (_plane_distances(source, target, heights, np.arange(len(source))), sampled):
        distances = start
        least = min(least, float(np.median(distances)))
        for _ in range(_TRIMS):
            nearer = np.flatnonzero(distances <= np.median(distances))
            distances = _plane_distances(source, target, heights, nearer)
            least = min(least, float(np.median(distances)))
    return least if np.isfinite(least) else float("nan")


def _plane_distances(source: Floats, target: Floats, heights: Floats, fitted: NDArray[np.intp]) -> Floats:
    """Return the distances of all points from the plane through some, in box heights; infinite: no plane."""
    try:
        plane = fit_homography(source[fitted], target[fitted])
    except ValueError:
        return np.full(len(source), np.inf)
    distances = np.hypot(*(apply_homography(plane, source) - target).T) / heights
    return np.asarray(np.nan_to_num(distances, nan=np.inf))


_CORNERS, _SAMPLES = 4, 500
"""Points through which a plane is fitted, and how often: two dozen times all four are of the nearer half."""
_TRIMS = 20

_Boxes = Mapping[tuple[int, int], tuple[float, float, float, float]]
"""By frame and person."""


def _compare_pair(
    one: Floats, here: _Boxes, other: Floats, there: _Boxes, both: Sequence[tuple[int, int]]
) -> GroundAgreement:
    boxes, other_boxes = (np.array([boxes_by_key[key] for key in both]) for boxes_by_key in (here, there))
    height = float(
        np.nanmedian(np.concatenate([person_heights(one, boxes), person_heights(other, other_boxes)]))
    )
    positions = to_ground(one, foot_points(boxes))
    distances = np.hypot(*(positions - to_ground(other, foot_points(other_boxes))).T) / height
    distances = np.nan_to_num(distances, nan=np.inf)
    by_frame = defaultdict(list)
    for frame, person in there:
        by_frame[frame].append(person)
    other_positions = dict(
        zip(there, to_ground(other, foot_points(np.array(list(there.values())))), strict=True)
    )
    correct = 0
    for (frame, person), position in zip(both, positions, strict=True):
        candidates = {
            candidate: np.hypot(*(other_positions[frame, candidate] - position))
            for candidate in by_frame[frame]
        }
        nearest = min(candidates, key=lambda person: np.nan_to_num(candidates[person], nan=np.inf))
        correct += nearest == person
    return GroundAgreement(
        float(np.median(distances)), float(np.quantile(distances, 0.9)), correct / len(both)
    )


def _people(path: Path, size: tuple[int, int]) -> _Boxes:
    """Return the boxes of a file that the picture's edges do not truncate."""
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
