"""All overlapping pairs of many rectangles, by a plane sweep."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.association.index_ranges import expand_counts

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_BANDS = 0.5
"""Bands, in roots of the number of rectangles."""


def overlapping(low: Floats, high: Floats) -> tuple[Ints, Ints]:
    """Return the pairs of rectangles that overlap, each once: (P,) and (P,), the lower index first, in order.

    The plane is cut into bands with as many rectangles in each, and in each band a line sweeps over them
    (Bentley and Wood, 1980), so that time is linear in the number of rectangles if each meets a few.

    Args:
        low: (N, 2) lower corners.
        high: (N, 2) upper corners, not below.
    """
    count = len(low)
    middle = np.sort(low[:, 1] + high[:, 1]) / 2.0
    bands = max(1, int(_BANDS * np.sqrt(count)))
    edges = middle[np.arange(1, bands) * count // bands]
    first, last = (np.searchsorted(edges, side[:, 1], side="right") for side in (low, high))
    item, which = expand_counts(last - first + 1)
    band = first[item] + which
    # Places along the sweep instead of coordinates, so that a band and a place make one number to sort by.
    along = np.argsort(low[:, 0], kind="stable")
    place = np.empty(count, dtype=np.int64)
    place[along] = np.arange(count)
    stop = np.searchsorted(low[along, 0], high[:, 0], side="right")
    key = band * (count + 1) + place[item]
    order = np.argsort(key)
    item, band, key = item[order], band[order], key[order]
    reach = np.searchsorted(key, band * (count + 1) + stop[item])
    at, which = expand_counts(reach - np.arange(key.size) - 1)
    one, two = item[at], item[at + 1 + which]
    beside = (low[one, 1] <= high[two, 1]) & (low[two, 1] <= high[one, 1])
    # Two that share several bands are taken in the first of them.
    beside &= band[at] == np.maximum(first[one], first[two])
    one, two = np.minimum(one, two)[beside], np.maximum(one, two)[beside]
    order = np.lexsort((two, one))
    return one[order], two[order]
