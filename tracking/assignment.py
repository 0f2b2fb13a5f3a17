"""Optimal one-to-one assignment in one frame (Hungarian algorithm)."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from tracking.boxes import Floats

_ROUNDING_ERROR = float(np.finfo(np.float64).eps)
"""A similarity may be below the minimum by this much."""


def assign_pairs(
    similarity: Floats, min_similarity: float, bonus: Floats | None = None
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Assign rows to columns so that the total similarity plus bonus is largest.

    Args:
        similarity: `(T, R)`.
        min_similarity: least similarity of a pair.
        bonus: `(T, R)`, added to the similarity of pairs.

    Returns:
        `(P,)` rows and `(P,)` columns of the pairs.
    """
    possible = similarity >= min_similarity - _ROUNDING_ERROR
    value = np.where(possible, similarity if bonus is None else similarity + bonus, 0.0)
    rows, columns = scipy.optimize.linear_sum_assignment(value, maximize=True)
    paired = possible[rows, columns]
    return rows[paired], columns[paired]
