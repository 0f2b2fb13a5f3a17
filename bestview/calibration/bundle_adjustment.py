"""All cameras at once, moved until feet agree as well as they can: least squares over everything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from bestview.calibration.floor_agreement import FloorPositions, project_to_floor, whitened_differences
from bestview.calibration.homography import Floats
from bestview.calibration.pinhole import PARAMETERS, POSE, Pinhole
from bestview.calibration.priors import height_errors, prior_errors, robust
from bestview.calibration.samples import Indices, WalkSamples, select_moving_samples
from bestview.calibration.walk_settings import WalkSettings
from bestview.geometry.ground_plane import foot_points

_HEIGHTS = 200
"""Boxes of each camera whose height counts."""
_MOST_MATCHES = 600
"""Matches of two cameras that count; evenly chosen of more."""
_OFF_FLOOR_ERROR = 20.0
_SHARPEST = 0.2
"""Standard deviations are never guessed to be smaller than this share of what the settings say."""
_OFFSET_SPREAD = 100.0
"""Frames; a weak pull of offsets towards where they were, for cameras that nothing ties."""
_EVALUATIONS = 12


@dataclass(frozen=True, slots=True)
class Correspondences:
    """Moments at which two cameras see one person.

    Attributes:
        one: the number of the one camera, and `other` of the other.
        here: the sample of the one camera, (M,), and `there` of the other.
        weight: how much of a new place each is, (M,).
    """

    one: int
    other: int
    here: Indices
    there: Indices
    weight: Floats

    def thinned(self) -> Correspondences:
        """Leave out what is too much."""
        step = max(1, -(-len(self.here) // _MOST_MATCHES))
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
    in_step: bool = False,
) -> CameraRig:
    """Move the cameras and their offsets; the first one's place, direction and offset stay.

    Args:
        rig: where they are now; the samples are taken with its offsets.
        samples: one for each camera.
        matches: who is one person.
        settings: what counts how much.
        sharpness: how much more exactly feet are found than the settings say.
        in_step: offsets are known and stay.
    """
    count = len(rig.cameras)
    given = np.concatenate([camera.parameters for camera in rig.cameras])
    free = np.ones(count * (PARAMETERS + 1), dtype=bool)
    free[POSE] = False
    free[count * PARAMETERS] = False
    if in_step:
        free[count * PARAMETERS :] = False
    start = np.concatenate([given, np.zeros(count)])
    thin = [it.thinned() for it in matches]
    boxes = [select_moving_samples(it, _HEIGHTS) for it in samples]
    tall = [
        (it.feet[chosen], it.tall[chosen], it.weight[chosen])
        for it, chosen in zip(samples, boxes, strict=True)
    ]

    def errors(values: Floats) -> Floats:
        all_values = start.copy()
        all_values[free] = values
        later = all_values[count * PARAMETERS :]
        cameras = _cameras(rig, all_values)
        parts = [later / _OFFSET_SPREAD]
        for camera, (where, height, weight) in zip(cameras, tall, strict=True):
            parts += [prior_errors(camera, settings), height_errors(camera, where, height, weight, settings)]
        parts += [_match_errors(cameras, later, samples, it, settings, sharpness) for it in thin]
        return np.concatenate(parts)

    found = scipy.optimize.least_squares(errors, start[free], x_scale="jac", ftol=1e-5, max_nfev=_EVALUATIONS)
    values = start.copy()
    values[free] = found.x
    return CameraRig(tuple(_cameras(rig, values)), rig.offsets + values[count * PARAMETERS :])


def floor_residuals(
    cameras: Sequence[Pinhole],
    later: Floats,
    samples: Sequence[WalkSamples],
    it: Correspondences,
    settings: WalkSettings,
) -> Floats:
    """How far apart the two cameras put each person, whitened, (M, 2); NaN where nowhere.

    `later` is by how many frames each camera's offset is later than the samples were taken with, (C,).
    """

    def end_frame(number: int, index: Indices) -> FloorPositions:
        boxes = samples[number].boxes[index] - later[number] * samples[number].speed[index]
        return project_to_floor(cameras[number], foot_points(boxes), boxes[:, 3] - boxes[:, 1], settings)

    return whitened_differences(end_frame(it.one, it.here), end_frame(it.other, it.there), settings)


def _match_errors(
    cameras: Sequence[Pinhole],
    later: Floats,
    samples: Sequence[WalkSamples],
    it: Correspondences,
    settings: WalkSettings,
    sharpness: float,
) -> Floats:
    off = floor_residuals(cameras, later, samples, it, settings) * sharpness
    far = np.hypot(*off.T)
    seen = np.isfinite(far)
    far = np.where(seen, far, _OFF_FLOOR_ERROR)
    off = np.where(seen[:, None], off, _OFF_FLOOR_ERROR)
    less = robust(far) / np.maximum(far, 1e-9)
    return np.asarray((off * (less * np.sqrt(it.weight))[:, None]).ravel())


def _cameras(rig: CameraRig, values: Floats) -> list[Pinhole]:
    return [
        replace(camera, parameters=values[number * PARAMETERS : (number + 1) * PARAMETERS])
        for number, camera in enumerate(rig.cameras)
    ]


def estimate_sharpness(off: Floats) -> float:
    """How much more exactly feet agree than the settings say, from whitened distances, (M, 2)."""
    typical = float(np.median(np.hypot(*off.T))) / 1.18 if len(off) else 1.0  # Rayleigh's median
    return 1.0 / min(max(typical, _SHARPEST), 1.0)
