"""Optimal one-to-one assignment in one frame (Hungarian algorithm)."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from tracking.boxes import Floats

_ROUNDING_ERROR = float(np.finfo(np.float64).eps)
"""An overlap that is the least one but for its last digit is enough."""


def assign_pairs(
    similarity: Floats, least: float, bonus: Floats | None = None
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Assign rows to columns so that the total similarity (and bonus) is largest.

    Args:
        similarity: `(T, R)`.
        least: pairs that are less similar are no pairs.
        bonus: `(T, R)`, added to the similarity of pairs.

    Returns:
        `(P,)` rows and `(P,)` columns of the pairs.
    """
    possible = similarity >= least - _ROUNDING_ERROR
    worth = np.where(possible, similarity if bonus is None else similarity + bonus, 0.0)
    rows, columns = scipy.optimize.linear_sum_assignment(worth, maximize=True)
    paired = possible[rows, columns]
    return rows[paired], columns[paired]
