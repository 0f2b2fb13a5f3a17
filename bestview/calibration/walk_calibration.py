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
        floor: number of its floor; cameras with one number share one.
        homography: its pixels to the floor, (3, 3), a person being `person` tall.
        offset: the pulse at which its frame 0 was taken, frames, against the first camera of its floor.
        offset_error: the standard error of the offset, frames.
        image: foot points that another camera saw too, (N, 2) pixels.
        position: mean of both cameras' positions of them, (N, 2) on the floor.
        heights: distance between both positions on the floor, in person heights.
        picture: distance of the other's position in this picture, as a share of its diagonal.
        thirds: share of these foot points in the left, middle and right third of the picture, (3,).
        depth_ratio: how many times as tall the nearest of them appear as the farthest.
    """

    camera: str
    floor: int
    homography: Floats
    offset: float
    offset_error: float
    image: Floats
    position: Floats
    heights: ErrorSummary
    picture: ErrorSummary
    thirds: tuple[float, float, float]
    depth_ratio: float


@dataclass(frozen=True, slots=True)
class UncalibratedCamera:
    """A camera without a place on a floor, and why."""

    camera: str
    reason: str


@dataclass(frozen=True, slots=True)
class WalkCalibration:
    """Result of a calibration.

    Attributes:
        cameras: those that could be placed, in the order given.
        uncalibrated: the others.
        heights: distance between two cameras' positions of the same foot points, in person heights.
        picture: the same in the pictures, as a share of the diagonal.
    """

    cameras: tuple[CameraCalibration, ...]
    uncalibrated: tuple[UncalibratedCamera, ...]
    heights: ErrorSummary
    picture: ErrorSummary


def calibrate_from_walks(
    walks: Sequence[Walk], settings: WalkSettings | None = None, person: float = 1.75
) -> WalkCalibration:
    """Calibrate cameras on one floor from what they saw of people who walked about while all of them ran.

    Args:
        walks: one for each camera, two at least.
        settings: of the comparison.
        person: how tall people are in the unit of the floor.

    Raises:
        CalibrationError: no two cameras could be placed on one floor, or not all at once; the text says why.
    """
    settings = settings or WalkSettings()
    if len(walks) < 2:  # noqa: PLR2004 — two cameras
        raise CalibrationError("a walk takes two cameras at least, which see the same floor")
    pairs = align_camera_pairs(walks, settings)
    groups = group_cameras(walks, pairs, settings)
    if not groups:
        raise CalibrationError(_rejection_text(walks, max(pairs, key=_alignment_merit), settings))
    grouped = {number for group in groups for number in group.members}
    left_out = []
    for number in sorted(set(range(len(walks))) - grouped):
        best = max((it for it in pairs if number in (it.one, it.other)), key=_alignment_merit)
        left_out.append(UncalibratedCamera(walks[number].camera, _rejection_text(walks, best, settings)))
    offset_errors = [offset_standard_errors(it.rig, it.samples, it.matches, settings) for it in groups]
    calibrated = [
        _camera(walks[number].camera, floor, group, place, errors, person)
        for floor, (group, errors) in enumerate(zip(groups, offset_errors, strict=True))
        for place, number in enumerate(group.members)
    ]
    order = {walk.camera: number for number, walk in enumerate(walks)}
    off = [_correspondence_errors(group, it, it.other) for group in groups for it in group.matches]
    return WalkCalibration(
        tuple(sorted(calibrated, key=lambda it: order[it.camera])),
        tuple(left_out),
        _summarize([it.heights for it in off]),
        _summarize([it.picture for it in off]),
    )


@dataclass(frozen=True, slots=True)
class _CorrespondenceErrors:
    """Errors of one camera's correspondences with another, (M,) each, and where they are."""

    heights: Floats
    picture: Floats
    image: Floats
    position: Floats


def _correspondence_errors(group: CameraGroup, it: Correspondences, own: int) -> _CorrespondenceErrors:
    """Compute the errors of one of the two cameras of some correspondences."""
    index, across, there = (it.here, it.other, it.there) if own == it.one else (it.there, it.one, it.here)
    camera = group.rig.cameras[own]
    image = group.samples[own].feet[index]
    mine = camera.floor(image)
    other = group.rig.cameras[across].floor(group.samples[across].feet[there])
    aside = np.hypot(*(camera.picture(other) - image).T) / np.hypot(*camera.size)
    return _CorrespondenceErrors(np.hypot(*(mine - other).T), aside, image, (mine + other) / 2)


def _camera(
    name: str, floor: int, group: CameraGroup, own: int, errors: Floats, person: float
) -> CameraCalibration:
    off = [_correspondence_errors(group, it, own) for it in group.matches if own in (it.one, it.other)]
    image, place = np.concatenate([it.image for it in off]), np.concatenate([it.position for it in off])
    if not len(image):
        raise CalibrationError(f"{name}: on one floor with all others it agrees with none: try without it")
    tall = group.rig.cameras[own].heights(image)
    third = np.clip((3 * image[:, 0] / group.rig.cameras[own].size[0]).astype(int), 0, 2)
    left, middle, right = (float(it) for it in np.bincount(third, minlength=3) / max(1, len(third)))
    shift = np.array([floor * _FLOOR_DISTANCE, 0.0])
    moved = np.eye(3)
    moved[:2, 2] = shift * person
    homography = moved @ group.rig.cameras[own].homography(person)
    return CameraCalibration(
        camera=name,
        floor=floor,
        homography=homography / np.abs(homography).max(),
        offset=float(group.rig.offsets[own]),
        offset_error=float(errors[own]),
        image=image,
        position=(place + shift) * person,
        heights=_summarize([it.heights for it in off]),
        picture=_summarize([it.picture for it in off]),
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
