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
"""Frames; a weak prior that keeps offsets in place for cameras that nothing constrains."""
_EVALUATIONS = 12
_PARTS = 8
_TINY = 1e-6


@dataclass(frozen=True, slots=True)
class Correspondences:
    """Samples in which two cameras see one person at the same pulse.

    Attributes:
        one: number of the one camera, and `other` of the other.
        here: sample of the one camera, (M,), and `there` of the other.
        weight: how much of a new place each is, (M,).
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
    """Cameras on one floor, and the pulse at which each one's frame 0 was taken, (C,)."""

    cameras: tuple[Pinhole, ...]
    offsets: Floats


def adjust_bundle(
    rig: CameraRig,
    samples: Sequence[WalkSamples],
    matches: Sequence[Correspondences],
    settings: WalkSettings,
    *,
    sharpness: float = 1.0,
    fixed_offsets: bool = False,
) -> CameraRig:
    """Optimize the cameras and their offsets; the pose and offset of the first camera are fixed.

    Args:
        rig: initial cameras; the samples are taken with its offsets.
        samples: one for each camera.
        matches: correspondences.
        settings: weights and priors.
        sharpness: how much more precise foot points are than the settings say.
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
    thinned = [it.thinned() for it in matches]
    boxes = [select_moving_samples(it, _MAX_HEIGHTS) for it in samples]
    heights = [
        (it.feet[chosen], it.tall[chosen], it.weight[chosen])
        for it, chosen in zip(samples, boxes, strict=True)
    ]

    def errors(values: Floats) -> Floats:
        all_values = start.copy()
        all_values[free] = values
        later = all_values[count * PARAMETERS :]
        cameras = _cameras(rig, all_values)
        parts = [later / _OFFSET_SPREAD]
        for camera, (where, height, weight) in zip(cameras, heights, strict=True):
            parts += [prior_errors(camera, settings), height_errors(camera, where, height, weight, settings)]
        parts += [_match_errors(cameras, later, samples, it, settings, sharpness) for it in thinned]
        return np.concatenate(parts)

    solution = scipy.optimize.least_squares(
        errors, start[free], x_scale="jac", ftol=1e-5, max_nfev=_EVALUATIONS
    )
    values = start.copy()
    values[free] = solution.x
    return CameraRig(tuple(_cameras(rig, values)), rig.offsets + values[count * PARAMETERS :])


def floor_residuals(
    cameras: Sequence[Pinhole],
    later: Floats,
    samples: Sequence[WalkSamples],
    it: Correspondences,
    settings: WalkSettings,
) -> Floats:
    """Compute whitened floor distances between both cameras' foot points, (M, 2); NaN: off the floor.

    `later` is by how many frames each camera's offset is later than the samples were taken with, (C,).
    """

    def positions(number: int, index: Indices) -> FloorPositions:
        boxes = samples[number].boxes[index] - later[number] * samples[number].speed[index]
        return project_to_floor(cameras[number], foot_points(boxes), boxes[:, 3] - boxes[:, 1], settings)

    return whitened_differences(positions(it.one, it.here), positions(it.other, it.there), settings)


def _match_errors(
    cameras: Sequence[Pinhole],
    later: Floats,
    samples: Sequence[WalkSamples],
    it: Correspondences,
    settings: WalkSettings,
    sharpness: float,
) -> Floats:
    residuals = floor_residuals(cameras, later, samples, it, settings) * sharpness
    distance = np.hypot(*residuals.T)
    valid = np.isfinite(distance)
    distance = np.where(valid, distance, _OFF_FLOOR_ERROR)
    residuals = np.where(valid[:, None], residuals, _OFF_FLOOR_ERROR)
    robust_factor = robust(distance) / np.maximum(distance, 1e-9)
    return np.asarray((residuals * (robust_factor * np.sqrt(it.weight))[:, None]).ravel())


def _cameras(rig: CameraRig, values: Floats) -> list[Pinhole]:
    return [
        replace(camera, parameters=values[number * PARAMETERS : (number + 1) * PARAMETERS])
        for number, camera in enumerate(rig.cameras)
    ]


def estimate_sharpness(residuals: Floats) -> float:
    """Return how much more precise foot points are than the settings say, from whitened distances, (M, 2)."""
    typical = float(np.median(np.hypot(*residuals.T))) / 1.18 if len(residuals) else 1.0  # Rayleigh's median
    return 1.0 / min(max(typical, _MIN_FOOT_ERROR), 1.0)


def offset_standard_errors(
    rig: CameraRig, samples: Sequence[WalkSamples], matches: Sequence[Correspondences], settings: WalkSettings
) -> Floats:
    """Return the standard error of each camera's offset, (C,) frames; 0 for the first, the reference.

    The walk is cut into parts. In each the offsets are fitted to its own foot points, with the cameras fixed;
    the spread between the parts gives the error of the whole. Foot points that are tracked late, or shadows
    to one side, make parts differ in which people walk another way.
    """
    count = len(rig.cameras)
    start = min((float(it.times.min()) for it in samples if len(it.times)), default=0.0)
    end = max((float(it.times.max()) for it in samples if len(it.times)), default=0.0) + 1.0
    normal = np.zeros((_PARTS, count, count))
    right_hand_side = np.zeros((_PARTS, count))
    for it in matches:
        no_shift = np.zeros(count)
        residuals = floor_residuals(rig.cameras, no_shift, samples, it, settings)
        slope = np.zeros((len(residuals), 2, count))
        for camera in (it.one, it.other):
            later = no_shift.copy()
            later[camera] = 1.0
            slope[:, :, camera] = floor_residuals(rig.cameras, later, samples, it, settings) - residuals
        weight = it.weight / (1.0 + (residuals**2).sum(axis=1))
        weight = np.where(
            np.isfinite(residuals).all(axis=1) & np.isfinite(slope).all(axis=(1, 2)), weight, 0.0
        )
        part = (_PARTS * (samples[it.one].times[it.here] - start) / (end - start)).astype(int)
        residuals, slope = np.nan_to_num(residuals), np.nan_to_num(slope)
        np.add.at(normal, part, np.einsum("m,mki,mkj->mij", weight, slope, slope))
        np.add.at(right_hand_side, part, -np.einsum("m,mki,mk->mi", weight, slope, residuals))
    # The first camera is fixed; parts are weighted by their information.
    part_offsets = [
        np.linalg.solve(it[1:, 1:] + _TINY * np.eye(count - 1), goal[1:])
        for it, goal in zip(normal, right_hand_side, strict=True)
    ]
    information = np.array([np.diag(it)[1:] for it in normal])
    share = information / np.maximum(information.sum(axis=0), _TINY)
    spread = (share**2 * np.array(part_offsets) ** 2).sum(axis=0)
    return np.concatenate([[0.0], np.sqrt(spread)])
