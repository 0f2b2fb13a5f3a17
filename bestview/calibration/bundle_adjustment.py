"""Bundle adjustment: poses and time offsets of all cameras at once, and standard errors of the offsets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from bestview.calibration.floor_agreement import FloorPositions, project_to_floor, whitened_differences
from bestview.calibration.homography import Floats
from bestview.calibration.pinhole import PARAMETERS, POSE, Pinhole
from bestview.calibration.samples import Indices, WalkSamples, select_moving_samples
from bestview.calibration.single_camera import height_errors, prior_errors, robust
from bestview.calibration.walk_settings import WalkSettings
from bestview.geometry.ground_plane import foot_points

_MAX_HEIGHTS = 200
"""Boxes of each camera whose height counts."""
_MAX_MATCHES = 600
"""Correspondences of two cameras that count; of more, evenly chosen ones."""
_OFF_FLOOR_ERROR = 20.0
_MIN_FOOT_ERROR = 0.2
"""Lower bound of the estimated foot error, relative to the settings'."""
_OFFSET_SPREAD = 100.0
"""Frames; a weak prior that fixes the offsets of cameras without matches."""
_EVALUATIONS = 12
_PARTS = 8
_TINY = 1e-6


@dataclass(frozen=True, slots=True)
class Correspondences:
    """M matches: samples of two cameras that show one person at the same pulse.

    Attributes:
        one: index of the first camera.
        other: index of the second.
        here: (M,) samples of the first camera.
        there: (M,) samples of the second.
        weight: (M,) movement in strides, at most 1.
    """

    one: int
    other: int
    here: Indices
    there: Indices
    weight: Floats

    def thinned(self) -> Correspondences:
        """Return evenly chosen correspondences, at most `_MAX_MATCHES`."""
        step = max(1, -(-len(self.here) // _MAX_MATCHES))
        return replace(
            self, here=self.here[::step], there=self.there[::step], weight=self.weight[::step] * step
        )


@dataclass(frozen=True, slots=True)
class CameraRig:
    """Cameras on one floor, and the pulse of each camera's frame 0, (C,)."""

    cameras: tuple[Pinhole, ...]
    offsets: Floats


def adjust_bundle(
    rig: CameraRig,
    samples: Sequence[WalkSamples],
    matches: Sequence[Correspondences],
    settings: WalkSettings,
    *,
    foot_precision: float = 1.0,
    fixed_offsets: bool = False,
) -> CameraRig:
    """Optimize the cameras and their offsets; the pose and offset of the first camera are fixed.

    Args:
        rig: initial cameras, with whose offsets the walks were sampled.
        samples: of each camera.
        matches: correspondences.
        settings: weights and priors.
        foot_precision: how much more precise foot points are than the settings assume.
        fixed_offsets: offsets are known and not optimized.
    """
    count = len(rig.cameras)
    parameters = np.concatenate([camera.parameters for camera in rig.cameras])
    free = np.ones(count * (PARAMETERS + 1), dtype=bool)
    free[POSE] = False
    free[count * PARAMETERS] = False
    if fixed_offsets:
        free[count * PARAMETERS :] = False
    start = np.concatenate([parameters, np.zeros(count)])
    thinned = [match.thinned() for match in matches]
    boxes = [select_moving_samples(sample_set, _MAX_HEIGHTS) for sample_set in samples]
    heights = [
        (sample_set.feet[chosen], sample_set.tall[chosen], sample_set.weight[chosen])
        for sample_set, chosen in zip(samples, boxes, strict=True)
    ]

    def errors(values: Floats) -> Floats:
        all_values = start.copy()
        all_values[free] = values
        offset_changes = all_values[count * PARAMETERS :]
        cameras = _cameras(rig, all_values)
        parts = [offset_changes / _OFFSET_SPREAD]
        for camera, (where, height, weight) in zip(cameras, heights, strict=True):
            parts += [prior_errors(camera, settings), height_errors(camera, where, height, weight, settings)]
        parts += [
            _match_errors(cameras, offset_changes, samples, match, settings, foot_precision)
            for match in thinned
        ]
        return np.concatenate(parts)

    solution = scipy.optimize.least_squares(
        errors, start[free], x_scale="jac", ftol=1e-5, max_nfev=_EVALUATIONS
    )
    values = start.copy()
    values[free] = solution.x
    return CameraRig(tuple(_cameras(rig, values)), rig.offsets + values[count * PARAMETERS :])


def floor_residuals(
    cameras: Sequence[Pinhole],
    offset_changes: Floats,
    samples: Sequence[WalkSamples],
    match: Correspondences,
    settings: WalkSettings,
) -> Floats:
    """Compute whitened floor distances between both cameras' foot points, (M, 2); NaN: off the floor.

    `offset_changes` (C,) are those of the offsets since the walks were sampled, frames.
    """

    def positions(number: int, index: Indices) -> FloorPositions:
        boxes = samples[number].boxes[index] - offset_changes[number] * samples[number].speed[index]
        return project_to_floor(cameras[number], foot_points(boxes), boxes[:, 3] - boxes[:, 1], settings)

    return whitened_differences(
        positions(match.one, match.here), positions(match.other, match.there), settings
    )


def _match_errors(
    cameras: Sequence[Pinhole],
    offset_changes: Floats,
    samples: Sequence[WalkSamples],
    match: Correspondences,
    settings: WalkSettings,
    foot_precision: float,
) -> Floats:
    residuals = floor_residuals(cameras, offset_changes, samples, match, settings) * foot_precision
    distance = np.hypot(*residuals.T)
    valid = np.isfinite(distance)
    distance = np.where(valid, distance, _OFF_FLOOR_ERROR)
    residuals = np.where(valid[:, None], residuals, _OFF_FLOOR_ERROR)
    robust_factor = robust(distance) / np.maximum(distance, 1e-9)
    return np.asarray((residuals * (robust_factor * np.sqrt(match.weight))[:, None]).ravel())


def _cameras(rig: CameraRig, values: Floats) -> list[Pinhole]:
    return [
        replace(camera, parameters=values[number * PARAMETERS : (number + 1) * PARAMETERS])
        for number, camera in enumerate(rig.cameras)
    ]


def estimate_foot_precision(residuals: Floats) -> float:
    """Estimate how much more precise foot points are than the settings assume, from residuals (M, 2)."""
    typical = float(np.median(np.hypot(*residuals.T))) / 1.18 if len(residuals) else 1.0  # Rayleigh's median
    return 1.0 / min(max(typical, _MIN_FOOT_ERROR), 1.0)


def offset_standard_errors(
    rig: CameraRig, samples: Sequence[WalkSamples], matches: Sequence[Correspondences], settings: WalkSettings
) -> Floats:
    """Return the standard error of each camera's offset, (C,) frames; 0 for the first, the reference.

    The walk is cut into parts. In each the offsets are fitted to the part's foot points, with the cameras
    fixed; the spread between the parts gives the error of the whole. Late tracking, or shadows to one side,
    shift the offsets of parts in which people walk in different directions.
    """
    count = len(rig.cameras)
    start = min(
        (float(sample_set.times.min()) for sample_set in samples if len(sample_set.times)), default=0.0
    )
    end = (
        max((float(sample_set.times.max()) for sample_set in samples if len(sample_set.times)), default=0.0)
        + 1.0
    )
    normal = np.zeros((_PARTS, count, count))
    right_hand_side = np.zeros((_PARTS, count))
    for match in matches:
        no_shift = np.zeros(count)
        residuals = floor_residuals(rig.cameras, no_shift, samples, match, settings)
        slope = np.zeros((len(residuals), 2, count))
        for camera in (match.one, match.other):
            offset_changes = no_shift.copy()
            offset_changes[camera] = 1.0
            slope[:, :, camera] = (
                floor_residuals(rig.cameras, offset_changes, samples, match, settings) - residuals
            )
        weight = match.weight / (1.0 + (residuals**2).sum(axis=1))
        weight = np.where(
            np.isfinite(residuals).all(axis=1) & np.isfinite(slope).all(axis=(1, 2)), weight, 0.0
        )
        part = (_PARTS * (samples[match.one].times[match.here] - start) / (end - start)).astype(int)
        residuals, slope = np.nan_to_num(residuals), np.nan_to_num(slope)
        np.add.at(normal, part, np.einsum("m,mki,mkj->mij", weight, slope, slope))
        np.add.at(right_hand_side, part, -np.einsum("m,mki,mk->mi", weight, slope, residuals))
    # The first camera is fixed; parts are weighted by their information.
    part_offsets = [
        np.linalg.solve(matrix[1:, 1:] + _TINY * np.eye(count - 1), goal[1:])
        for matrix, goal in zip(normal, right_hand_side, strict=True)
    ]
    information = np.array([np.diag(matrix)[1:] for matrix in normal])
    share = information / np.maximum(information.sum(axis=0), _TINY)
    spread = (share**2 * np.array(part_offsets) ** 2).sum(axis=0)
    return np.concatenate([[0.0], np.sqrt(spread)])
