"""Appearance scores of one update for pairs of tracklets of two cameras."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy
from numpy.typing import NDArray

_MAXIMUM_SCORE = 0.5
"""Largest score of one update."""

_SWAP_MARGIN = 0.4
"""Share of the gate by which any exchange of partners must be worse for a pair to count."""


@dataclass(frozen=True, slots=True)
class PairScores:
    """Scores of P pairs of tracklets of different cameras.

    Attributes:
        first: (P,) rows.
        second: (P,) rows, above `first`.
        score: (P,).
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    score: NDArray[np.float64]

    @classmethod
    def concatenate(cls, parts: Sequence[PairScores]) -> PairScores:
        """Concatenate scores of different pairs."""
        none = cls(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))
        every = [none, *parts]
        return cls(
            np.concatenate([part.first for part in every]),
            np.concatenate([part.second for part in every]),
            np.concatenate([part.score for part in every]),
        )


def score_camera_pairs(
    cameras: Sequence[slice],
    calibrated: Sequence[bool],
    distances_between: Callable[[slice, slice], NDArray[np.float64]],
    gate: float,
) -> PairScores:
    """Score the likeness of tracklets of two cameras without common ground.

    The tracklets of two cameras are assigned to each other as a whole, with the least total distance. A pair
    of that assignment counts for one person only if no exchange of partners would be nearly as good; a pair
    further apart than the gate counts against; all others score 0.

    Args:
        cameras: rows of each camera's tracklets, rising.
        calibrated: for each camera; two calibrated ones are compared on the ground instead.
        distances_between: (A, B) appearance distances between two cameras' rows; NaN: unknown.
        gate: distance above which two histograms are two people's.

    Returns:
        Scores in [-0.5, 0.5] where the distance is known.
    """
    parts = []
    for (first, ground_one), (second, ground_two) in combinations(zip(cameras, calibrated, strict=True), 2):
        if not (ground_one and ground_two):
            score = _camera_pair(distances_between(first, second), gate)
            row, column = np.nonzero(~np.isnan(score))
            parts.append(PairScores(first.start + row, second.start + column, score[row, column]))
    return PairScores.concatenate(parts)


def _camera_pair(distances: NDArray[np.float64], gate: float) -> NDArray[np.float64]:
    """Compute the scores of (A, B) pairs; NaN where unknown."""
    gate_ratio = np.full(distances.shape, np.nan)
    np.divide(distances, gate, out=gate_ratio, where=~np.isnan(distances) & (gate > 0))
    if np.isnan(gate_ratio).all():
        return gate_ratio
    score = np.where(_unambiguous_pairs(gate_ratio), 1.0 - gate_ratio, np.clip(1.0 - gate_ratio, -1.0, 0.0))
    return _MAXIMUM_SCORE * score


def _unambiguous_pairs(gate_ratio: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the pairs of the best assignment of (A, B) distances that no exchange comes close to."""
    rows, columns = gate_ratio.shape
    # Staying alone costs a gate: padded, everybody has a partner or stays alone.
    square = np.ones((rows + columns, rows + columns))
    square[:rows, :columns] = np.where(np.isnan(gate_ratio), 1.0, np.minimum(gate_ratio, 1.0))
    square[rows:, columns:] = 0.0
    _, partner = scipy.optimize.linear_sum_assignment(square)
    own_cost = square[np.arange(rows + columns), partner]
    swapped = square[:, partner]
    exchange = swapped + swapped.T - own_cost[:, None] - own_cost[None, :]
    np.fill_diagonal(exchange, np.inf)
    margin = exchange[:rows].min(axis=1, initial=np.inf)
    unambiguous = np.zeros((rows, columns), dtype=bool)
    for row in np.flatnonzero((partner[:rows] < columns) & (margin > _SWAP_MARGIN)).tolist():
        unambiguous[row, partner[row]] = gate_ratio[row, partner[row]] < 1
    return unambiguous
