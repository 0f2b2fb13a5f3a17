"""How sure the cameras' offsets are: what parts of the walk would say each for itself."""

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
    """Give the standard error of each camera's offset, (C,) frames; 0 of the first, which is the reference.

    The walk is cut into parts. In each the offsets are moved to where its own feet agree best, the cameras
    standing still; how much the parts differ is how unsure the whole is. A tracker that finds feet late, or
    lamps that throw shadows to one side, make parts differ in which people walk another way.
    """
    count = len(rig.cameras)
    start = min((float(it.times.min()) for it in samples if len(it.times)), default=0.0)
    end = max((float(it.times.max()) for it in samples if len(it.times)), default=0.0) + 1.0
    normal = np.zeros((_PARTS, count, count))
    towards = np.zeros((_PARTS, count))
    for it in matches:
        still = np.zeros(count)
        off = floor_residuals(rig.cameras, still, samples, it, settings)
        slope = np.zeros((len(off), 2, count))
        for camera in (it.one, it.other):
            later = still.copy()
            later[camera] = 1.0
            slope[:, :, camera] = floor_residuals(rig.cameras, later, samples, it, settings) - off
        weight = it.weight / (1.0 + (off**2).sum(axis=1))
        weight = np.where(np.isfinite(off).all(axis=1) & np.isfinite(slope).all(axis=(1, 2)), weight, 0.0)
        part = (_PARTS * (samples[it.one].times[it.here] - start) / (end - start)).astype(int)
        off, slope = np.nan_to_num(off), np.nan_to_num(slope)
        np.add.at(normal, part, np.einsum("m,mki,mkj->mij", weight, slope, slope))
        np.add.at(towards, part, -np.einsum("m,mki,mk->mi", weight, slope, off))
    # The first camera stays; parts weigh as much as they know.
    alone = [
        np.linalg.solve(it[1:, 1:] + _TINY * np.eye(count - 1), goal[1:])
        for it, goal in zip(normal, towards, strict=True)
    ]
    known = np.array([np.diag(it)[1:] for it in normal])
    share = known / np.maximum(known.sum(axis=0), _TINY)
    spread = (share**2 * np.array(alone) ** 2).sum(axis=0)
    return np.concatenate([[0.0], np.sqrt(spread)])
