"""Standard errors of the cameras' time offsets, from parts of the walk."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bestview.calibration.bundle_adjustment import CameraRig, Correspondences, floor_residuals
from bestview.calibration.homography import Floats
from bestview.calibration.samples import WalkSamples
from bestview.calibration.walk_settings import WalkSettings

_PARTS = 8
_TINY = 1e-6


def offset_standard_errors(
    rig: CameraRig, samples: Sequence[WalkSamples], matches: Sequence[Correspondences], settings: WalkSettings
) -> Floats:
    """Return the standard error of each camera's offset, (C,) frames; 0 of the first, which is the reference.

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
    # The first camera stays; parts weigh as much as they know.
    part_offsets = [
        np.linalg.solve(it[1:, 1:] + _TINY * np.eye(count - 1), goal[1:])
        for it, goal in zip(normal, right_hand_side, strict=True)
    ]
    information = np.array([np.diag(it)[1:] for it in normal])
    share = information / np.maximum(information.sum(axis=0), _TINY)
    spread = (share**2 * np.array(part_offsets) ** 2).sum(axis=0)
    return np.concatenate([[0.0], np.sqrt(spread)])
