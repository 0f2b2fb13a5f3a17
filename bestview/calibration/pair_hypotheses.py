"""Hypotheses of the relative pose of two cameras, each from a pair of tracks that may be one person.

People's heights give each camera's tilt and height; a track is then a curve on the floor in person heights,
and two curves of one person differ by a rotation and a translation (Procrustes).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bestview.calibration.floor_agreement import FloorPositions
from bestview.calibration.homography import Floats
from bestview.calibration.samples import CandidateMatches

_MIN_PULSES = 5
_MIN_SPREAD = 0.3
"""Variance of positions, person heights squared, below which a track is too short to align."""
_NOISE = 0.1


@dataclass(frozen=True, slots=True)
class RelativePose:
    """Rotation (radians) and then translation, (2,), of one camera's floor onto the other's.

    `here` and `there` are the indices of the two cameras' pose hypotheses.
    """

    merit: float
    here: int
    there: int
    rotation: float
    translation: Floats


def propose_relative_poses(
    here: Sequence[FloorPositions],
    there: Sequence[FloorPositions],
    candidates: CandidateMatches,
    maximum: int,
) -> list[RelativePose]:
    """Return the best relative poses, best first, over all combinations of the cameras' possible poses."""
    poses = [
        pose
        for a, one in enumerate(here)
        for b, other in enumerate(there)
        for pose in _poses_of_views(a, one, b, other, candidates)
    ]
    poses.sort(key=lambda pose: -pose.merit)
    return poses[:maximum]


def _poses_of_views(
    a: int, one: FloorPositions, b: int, other: FloorPositions, candidates: CandidateMatches
) -> list[RelativePose]:
    """Fit a rotation and translation to each pair of tracks, all at once in complex numbers."""
    x = one.position[candidates.here] @ np.array([1, 1j])
    y = other.position[candidates.there] @ np.array([1, 1j])
    weight = np.where(np.isfinite(x) & np.isfinite(y), candidates.weight, 0.0)
    x, y = np.nan_to_num(x), np.nan_to_num(y)
    size = len(candidates.tracks)

    def total(values: np.ndarray) -> np.ndarray:
        real, imaginary = (
            np.bincount(candidates.track_pair, weight * part, size) for part in (values.real, values.imag)
        )
        return np.asarray(real + 1j * imaginary)

    count = total(np.ones(len(x))).real
    pulse_count = np.bincount(candidates.track_pair, weight > 0, size)
    safe_count = np.maximum(count, 1e-9)
    x_mean, y_mean = total(x) / safe_count, total(y) / safe_count
    x, y = x - x_mean[candidates.track_pair], y - y_mean[candidates.track_pair]
    x_spread, y_spread = (total(np.abs(positions) ** 2).real / safe_count for positions in (x, y))
    cross_spread = total(np.conj(x) * y) / safe_count
    residual = x_spread + y_spread - 2 * np.abs(cross_spread)
    smaller_spread = np.minimum(x_spread, y_spread)
    merit = np.where(
        (pulse_count >= _MIN_PULSES) & (smaller_spread > _MIN_SPREAD),
        count * smaller_spread / (np.maximum(residual, 0) + _NOISE),
        0.0,
    )
    turn = np.angle(cross_spread)
    shift = y_mean - x_mean * np.exp(1j * turn)
    return [
        RelativePose(float(merit[k]), a, b, float(turn[k]), np.array([shift[k].real, shift[k].imag]))
        for k in np.flatnonzero(merit > 0)
    ]
