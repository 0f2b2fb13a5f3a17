"""Matching of published objects with ground-truth people over several cameras."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

NO_PERSON = -1


def match_objects_to_people(matches: NDArray[np.int64]) -> NDArray[np.int64]:
    """Assign each object to one person and each person to one object, with the largest total of matches.

    As for IDF1 (Ristani et al., 2016), over all cameras together.

    Args:
        matches: (K, O) number of frames of all cameras in which each of K people was at each of O objects'
            boxes.

    Returns:
        (O,) the index of each object's person; -1: none.

    Raises:
        ValueError: matches that are no table.
    """
    if matches.ndim != 2:  # noqa: PLR2004 — people, objects
        raise ValueError(f"matches have shape {matches.shape}, not (people, objects)")
    people = np.full(matches.shape[1], NO_PERSON, dtype=np.int64)
    rows, columns = scipy.optimize.linear_sum_assignment(matches, maximize=True)
    matched = matches[rows, columns] > 0
    people[columns[matched]] = rows[matched]
    return people
