"""Which tracks may be one person by where they stand: found without looking at all pairs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.ragged import ranges

_SLACK = 1.0 + 1e-6
"""Rounding must not lose a pair at the very edge."""


def within_reach(
    ground: NDArray[np.float64], spread: NDArray[np.float64], gate: float, gates: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of tracks that are at most `gates` gates apart in some frame, and others.

    Feet are `gates` apart at most if ``d' (S1 + S2 + gate^2 I)^-1 d <= gates^2``, and then along every
    axis ``d^2 <= gates^2 (S1 + S2 + gate^2)``. So the two boxes of half width ``gates sqrt(S + gate^2 / 2)``
    about the feet overlap. A track's box here holds those of all its frames; overlaps are found by
    sorting along one axis. Nothing that could count is left out.

    Args:
        ground: (T, W, 2) feet on the ground, NaN where unknown.
        spread: (T, W, 2, 2) their covariance, NaN likewise.
        gate: ground units.
        gates: how many gates apart still counts.

    Returns:
        (P,) and (P,) rows, the first lower.
    """
    variance = np.stack([spread[..., 0, 0], spread[..., 1, 1]], axis=-1)
    half = gates * np.sqrt(variance + gate**2 / 2.0) * _SLACK
    known = ~np.isnan(ground + half)
    low = np.where(known, ground - half, np.inf).min(axis=1, initial=np.inf)
    high = np.where(known, ground + half, -np.inf).max(axis=1, initial=-np.inf)
    rows = np.flatnonzero((low <= high).all(axis=1))
    one, two = overlapping(low[rows], high[rows])
    return rows[one], rows[two]


def overlapping(
    low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of boxes, (N, 2) lower and (N, 2) upper corners, that share a point; the first lower."""
    sweeps = [_sweep(low[:, axis], high[:, axis]) for axis in (0, 1)]
    # Along the axis on which fewer overlap.
    axis = int(sweeps[1][1].sum() < sweeps[0][1].sum())
    order, counts = sweeps[axis]
    which, place = ranges(np.arange(1, order.size + 1), counts)
    low, high = (np.ascontiguousarray(corner[order, 1 - axis]) for corner in (low, high))
    both = np.flatnonzero((low[place] <= np.repeat(high, counts)) & (high[place] >= np.repeat(low, counts)))
    one, two = order[which[both]], order[place[both]]
    return np.minimum(one, two), np.maximum(one, two)


def _sweep(
    low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Order of intervals by their lower ends, and how many after each begin before it ends."""
    order = np.argsort(low, kind="stable")
    begun = np.searchsorted(low[order], high[order], side="right")
    return order, begun - np.arange(1, order.size + 1)
