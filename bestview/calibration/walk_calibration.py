"""Calibration of several cameras from a walk, with its errors and coverage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bestview.calibration.bundle_adjustment import Correspondences, offset_standard_errors
from bestview.calibration.camera_groups import CameraGroup, CameraPair, align_camera_pairs, group_cameras
from bestview.calibration.homography import Floats
from bestview.calibration.marked_points import CalibrationError
from bestview.calibration.walk_settings import WalkSettings
from bestview.calibration.walk_tracks import Walk

_FLOOR_DISTANCE = 100.0
"""Person heights between floors that no camera connects, beyond any error."""


@dataclass(frozen=True, slots=True)
class ErrorSummary:
    """Median and ninth decile of errors."""

    median: float
    ninth_decile: float


@dataclass(frozen=True, slots=True)
class CameraCalibration:
    """A calibrated camera.

    Attributes:
        camera: its name.
        floor: number of its floor, shared by the cameras of one group.
        homography: (3, 3) from its pixels to the floor, in the unit of the person height.
        offset: pulse of its frame 0, relative to the first camera of its floor, frames.
        offset_error: standard error of the offset, frames.
        image: (N, 2) foot points that were matched with another camera, pixels.
        position: (N, 2) mean of both cameras' positions of them on the floor.
        floor_error: distance between both positions on the floor, in person heights.
        image_error: distance of the other's position in this picture, as a share of the diagonal.
        thirds: (3,) share of these foot points in the left, middle and right third of the picture.
        depth_ratio: apparent height of the nearest of them over that of the farthest.
    """

    camera: str
    floor: int
    homography: Floats
    offset: float
    offset_error: float
    image: Floats
    position: Floats
    floor_error: ErrorSummary
    image_error: ErrorSummary
    thirds: tuple[float, float, float]
    depth_ratio: float


@dataclass(frozen=True, slots=True)
class UncalibratedCamera:
    """A camera that could not be placed on a floor, and why."""

    camera: str
    reason: str


@dataclass(frozen=True, slots=True)
class WalkCalibration:
    """Calibration of all cameras.

    Attributes:
        cameras: those that could be placed, in the order given.
        uncalibrated: the others.
        floor_error: distance between two cameras' positions of the same foot points, in person heights.
        image_error: the same in the pictures, as a share of the diagonal.
    """

    cameras: tuple[CameraCalibration, ...]
    uncalibrated: tuple[UncalibratedCamera, ...]
    floor_error: ErrorSummary
    image_error: ErrorSummary


def calibrate_from_walks(
    walks: Sequence[Walk], settings: WalkSettings, person_height: float = 1.75
) -> WalkCalibration:
    """Calibrate cameras on common floors from the tracks of people who walked through their views.

    Args:
        walks: of each camera, at least two.
        settings: of the comparison.
        person_height: how tall people are, in the unit of the floor to be.

    Raises:
        CalibrationError: no two cameras could be placed on one floor, or one agrees with none of its floor.
    """
    if len(walks) < 2:  # noqa: PLR2004 — two cameras
        raise CalibrationError("at least two cameras that see the same floor are needed")
    pairs = align_camera_pairs(walks, settings)
    groups = group_cameras(walks, pairs, settings)
    if not groups:
        raise CalibrationError(_rejection_text(walks, max(pairs, key=_alignment_merit), settings))
    grouped = {number for group in groups for number in group.members}
    left_out = []
    for number in sorted(set(range(len(walks))) - grouped):
        best = max((pair for pair in pairs if number in (pair.one, pair.other)), key=_alignment_merit)
        left_out.append(UncalibratedCamera(walks[number].camera, _rejection_text(walks, best, settings)))
    offset_errors = [
        offset_standard_errors(group.rig, group.samples, group.matches, settings) for group in groups
    ]
    calibrated = [
        _camera(walks[number].camera, floor, group, place, errors, person_height)
        for floor, (group, errors) in enumerate(zip(groups, offset_errors, strict=True))
        for place, number in enumerate(group.members)
    ]
    order = {walk.camera: number for number, walk in enumerate(walks)}
    off = [_correspondence_errors(group, match, match.other) for group in groups for match in group.matches]
    return WalkCalibration(
        tuple(sorted(calibrated, key=lambda calibration: order[calibration.camera])),
        tuple(left_out),
        _summarize([pair_errors.floor_error for pair_errors in off]),
        _summarize([pair_errors.image_error for pair_errors in off]),
    )


@dataclass(frozen=True, slots=True)
class _CorrespondenceErrors:
    """Errors of one camera's correspondences with another, (M,) each, and where they are."""

    floor_error: Floats
    image_error: Floats
    image: Floats
    position: Floats


def _correspondence_errors(group: CameraGroup, match: Correspondences, own: int) -> _CorrespondenceErrors:
    """Compute the errors of camera `own` of some correspondences."""
    index, across, there = (
        (match.here, match.other, match.there) if own == match.one else (match.there, match.one, match.here)
    )
    camera = group.rig.cameras[own]
    image = group.samples[own].feet[index]
    position = camera.floor(image)
    other_position = group.rig.cameras[across].floor(group.samples[across].feet[there])
    image_error = np.hypot(*(camera.picture(other_position) - image).T) / np.hypot(*camera.size)
    return _CorrespondenceErrors(
        np.hypot(*(position - other_position).T), image_error, image, (position + other_position) / 2
    )


def _camera(
    name: str, floor: int, group: CameraGroup, own: int, errors: Floats, person_height: float
) -> CameraCalibration:
    off = [
        _correspondence_errors(group, match, own)
        for match in group.matches
        if own in (match.one, match.other)
    ]
    image, place = (
        np.concatenate([pair.image for pair in off]),
        np.concatenate([pair.position for pair in off]),
    )
    if not len(image):
        raise CalibrationError(f"{name}: agrees with no other camera of its floor: calibrate without it")
    tall = group.rig.cameras[own].heights(image)
    third = np.clip((3 * image[:, 0] / group.rig.cameras[own].size[0]).astype(int), 0, 2)
    left, middle, right = (float(share) for share in np.bincount(third, minlength=3) / max(1, len(third)))
    shift = np.array([floor * _FLOOR_DISTANCE, 0.0])
    moved = np.eye(3)
    moved[:2, 2] = shift * person_height
    homography = moved @ group.rig.cameras[own].floor_homography(person_height)
    return CameraCalibration(
        camera=name,
        floor=floor,
        homography=homography / np.abs(homography).max(),
        offset=float(group.rig.offsets[own]),
        offset_error=float(errors[own]),
        image=image,
        position=(place + shift) * person_height,
        floor_error=_summarize([pair.floor_error for pair in off]),
        image_error=_summarize([pair.image_error for pair in off]),
        thirds=(left, middle, right),
        depth_ratio=float(np.nanquantile(tall, 0.95) / np.nanquantile(tall, 0.05)),
    )


def _summarize(errors: Sequence[Floats]) -> ErrorSummary:
    joined = np.concatenate([np.empty(0), *errors])
    joined = joined[np.isfinite(joined)]
    if not len(joined):
        return ErrorSummary(float("nan"), float("nan"))
    return ErrorSummary(float(np.median(joined)), float(np.quantile(joined, 0.9)))


def _alignment_merit(pair: CameraPair) -> float:
    """Return the merit of a pair's alignment; -1: none."""
    return -1.0 if pair.alignment is None else pair.alignment.merit


def _rejection_text(walks: Sequence[Walk], pair: CameraPair, settings: WalkSettings) -> str:
    one, other = walks[pair.one].camera, walks[pair.other].camera
    return f"{one} and {other}: {pair.rejection(settings)}"
