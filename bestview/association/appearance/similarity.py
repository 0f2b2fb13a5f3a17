"""Scores for one update: how much pairs of two cameras' tracks look like one person."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy
from numpy.typing import NDArray

_APPEARANCE_WEIGHT = 0.5
"""Most that likeness may say in one update."""

_UNCLEAR = 0.4
"""Share of the gate by which any exchange of partners must be worse for a pair to count."""


@dataclass(frozen=True, slots=True)
class Scores:
    """What an update says about P pairs of tracks of different cameras.

    Attributes:
        one: (P,) rows.
        two: (P,) rows, above `one`.
        score: (P,).
    """

    one: NDArray[np.int64]
    two: NDArray[np.int64]
    score: NDArray[np.float64]

    @classmethod
    def joined(cls, parts: Sequence[Scores]) -> Scores:
        """Put together scores of different pairs."""
        none = cls(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))
        every = [none, *parts]
        return cls(
            np.concatenate([part.one for part in every]),
            np.concatenate([part.two for part in every]),
            np.concatenate([part.score for part in every]),
        )


def appearance_scores(
    cameras: Sequence[slice],
    calibrated: Sequence[bool],
    unlike: Callable[[slice, slice], NDArray[np.float64]],
    gate: float,
) -> Scores:
    """Score likeness of pairs of tracks of two cameras that do not share a ground.

    Two cameras' tracks are assigned to each other as a whole, the likest in total. Only a pair of that
    assignment speaks for one person, and only where no exchange of partners would be nearly as good; a
    pair further apart than the gate speaks against; the others say nothing new (0).

    Args:
        cameras: rows of each camera's tracks, rising.
        calibrated: for each camera; two that are have the ground to compare by.
        unlike: (A, B) appearance distances between two cameras' rows; NaN: unknown.
        gate: distance above which two looks are two people's.

    Returns:
        Scores in [-0.5, 0.5] where likeness is known.
    """
    parts = []
    for (one, ground_one), (two, ground_two) in combinations(zip(cameras, calibrated, strict=True), 2):
        if not (ground_one and ground_two):
            score = _camera_pair(unlike(one, two), gate)
            row, column = np.nonzero(~np.isnan(score))
            parts.append(Scores(one.start + row, two.start + column, score[row, column]))
    return Scores.joined(parts)


def _camera_pair(unlike: NDArray[np.float64], gate: float) -> NDArray[np.float64]:
    """Scores of (A, B) pairs; NaN where unknown."""
    share = np.full(unlike.shape, np.nan)
    np.divide(unlike, gate, out=share, where=~np.isnan(unlike) & (gate > 0))
    if np.isnan(share).all():
        return share
    score = np.where(_clear_pairs(share), 1.0 - share, np.clip(1.0 - share, -1.0, 0.0))
    return _APPEARANCE_WEIGHT * score


def _clear_pairs(share: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pairs of the best assignment of (A, B) distances, in gates, that no exchange comes close to."""
    rows, columns = share.shape
    # Staying alone costs a gate: padded, everybody has a partner or stays alone.
    square = np.ones((rows + columns, rows + columns))
    square[:rows, :columns] = np.where(np.isnan(share), 1.0, np.minimum(share, 1.0))
    square[rows:, columns:] = 0.0
    _, partner = scipy.optimize.linear_sum_assignment(square)
    mine = square[np.arange(rows + columns), partner]
    swapped = square[:, partner]
    exchange = swapped + swapped.T - mine[:, None] - mine[None, :]
    np.fill_diagonal(exchange, np.inf)
    margin = exchange[:rows].min(axis=1, initial=np.inf)
    clear = np.zeros((rows, columns), dtype=bool)
    for row in np.flatnonzero((partner[:rows] < columns) & (margin > _UNCLEAR)).tolist():
        clear[row, partner[row]] = share[row, partner[row]] < 1
    return clear
