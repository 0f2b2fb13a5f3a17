"""Scores for one update: how much each pair of tracks looks like one person, by ground and by greys."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

_WORST = -2.0
"""Least score of an update: feet 1.7 gates apart or 17 say the same."""

_APPEARANCE_WEIGHT = 0.5
"""Most that likeness may say in one update: half of what standing on the same ground says."""

_UNCLEAR = 0.4
"""Share of the gate by which any exchange of partners must be worse for a pair to count."""


def ground_scores(distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Score ``1 - distance^2``, at least -2: (T, T) in gates -> (T, T); NaN where the distance is."""
    return np.asarray(np.maximum(1.0 - distances**2, _WORST))


def appearance_scores(
    unlike: NDArray[np.float64], camera: NDArray[np.int64], gate: float
) -> NDArray[np.float64]:
    """Score likeness of pairs of tracks in different cameras.

    Two cameras' tracks are assigned to each other as a whole, the likest in total. Only a pair of that
    assignment speaks for one person, and only where no exchange of partners would be nearly as good; a
    pair further apart than the gate speaks against; the others say nothing new (0).

    Args:
        unlike: (T, T) appearance distances of the tracks present; NaN: unknown.
        camera: (T,) camera index of each track.
        gate: distance above which two looks are two people's.

    Returns:
        (T, T) scores in [-0.5, 0.5]; NaN within a camera or where unknown.
    """
    share = np.full(unlike.shape, np.nan)
    np.divide(unlike, gate, out=share, where=~np.isnan(unlike) & (gate > 0))
    score = np.clip(1.0 - share, -1.0, 0.0)
    names = np.unique(camera)
    for i, one in enumerate(names):
        for two in names[i + 1 :]:
            block = np.ix_(np.flatnonzero(camera == one), np.flatnonzero(camera == two))
            clear = _clear_pairs(share[block])
            score[block] = np.where(clear, 1.0 - share[block], score[block])
            score[block[1].T, block[0].T] = score[block].T
    score[camera[:, None] == camera[None, :]] = np.nan
    return _APPEARANCE_WEIGHT * score


def _clear_pairs(share: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pairs of the best assignment of (A, B) distances, in gates, that no exchange comes close to."""
    rows, columns = share.shape
    # Staying alone costs a gate: padded, everybody has a partner or stays alone.
    square = np.ones((rows + columns, rows + columns))
    square[:rows, :columns] = np.where(np.isnan(share), 1.0, np.minimum(share, 1.0))
    square[rows:, columns:] = 0.0
    _, partner = linear_sum_assignment(square)
    mine = square[np.arange(rows + columns), partner]
    swapped = square[:, partner]
    exchange = swapped + swapped.T - mine[:, None] - mine[None, :]
    np.fill_diagonal(exchange, np.inf)
    margin = exchange[:rows].min(axis=1, initial=np.inf)
    clear = np.zeros((rows, columns), dtype=bool)
    for row in np.flatnonzero((partner[:rows] < columns) & (margin > _UNCLEAR)).tolist():
        clear[row, partner[row]] = share[row, partner[row]] < 1
    return clear
