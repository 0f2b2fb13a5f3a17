"""Guesses how two cameras stand to each other, each from one pair of tracks that may be one person's.

People's heights have told how each camera looks down on the floor; a track is then a curve on the floor
in person heights, and two curves of one person differ by a turn and a shift (Procrustes).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bestview.calibration.floor_agreement import FloorPositions
from bestview.calibration.homography import Floats
from bestview.calibration.samples import CandidateMatches

_LEAST_MOMENTS = 5
_LEAST_SPREAD = 0.3
"""Variance of places in person heights squared, below which somebody has hardly walked."""
_NOISE = 0.1


@dataclass(frozen=True, slots=True)
class RelativePose:
    """The one camera's floor is turned (radians) and then shifted, (2,), onto the other's.

    `here` and `there` say which of the views that the cameras may have was taken.
    """

    merit: float
    here: int
    there: int
    turn: float
    maximum_offset: Floats


def propose_relative_poses(
    here: Sequence[FloorPositions], there: Sequence[FloorPositions], meeting: CandidateMatches, most: int
) -> list[RelativePose]:
    """Give the best guesses, best first, for each way in which the two cameras may look down."""
    found = [
        guess
        for a, one in enumerate(here)
        for b, other in enumerate(there)
        for guess in _poses_of_views(a, one, b, other, meeting)
    ]
    found.sort(key=lambda it: -it.merit)
    return found[:most]


def _poses_of_views(
    a: int, one: FloorPositions, b: int, other: FloorPositions, meeting: CandidateMatches
) -> list[RelativePose]:
    """Lay one pair of tracks after another on top of each other, all at once in complex numbers."""
    x = one.position[meeting.here] @ np.array([1, 1j])
    y = other.position[meeting.there] @ np.array([1, 1j])
    weight = np.where(np.isfinite(x) & np.isfinite(y), meeting.weight, 0.0)
    x, y = np.nan_to_num(x), np.nan_to_num(y)
    size = len(meeting.tracks)

    def total(values: np.ndarray) -> np.ndarray:
        real, imaginary = (np.bincount(meeting.pair, weight * it, size) for it in (values.real, values.imag))
        return np.asarray(real + 1j * imaginary)

    count = total(np.ones(len(x))).real
    moments = np.bincount(meeting.pair, weight > 0, size)
    some = np.maximum(count, 1e-9)
    x_mean, y_mean = total(x) / some, total(y) / some
    x, y = x - x_mean[meeting.pair], y - y_mean[meeting.pair]
    x_spread, y_spread = (total(np.abs(it) ** 2).real / some for it in (x, y))
    together = total(np.conj(x) * y) / some
    left_over = x_spread + y_spread - 2 * np.abs(together)
    walked = np.minimum(x_spread, y_spread)
    merit = np.where(
        (moments >= _LEAST_MOMENTS) & (walked > _LEAST_SPREAD),
        count * walked / (np.maximum(left_over, 0) + _NOISE),
        0.0,
    )
    turn = np.angle(together)
    shift = y_mean - x_mean * np.exp(1j * turn)
    return [
        RelativePose(float(merit[k]), a, b, float(turn[k]), np.array([shift[k].real, shift[k].imag]))
        for k in np.flatnonzero(merit > 0)
    ]
