"""Index arrays for pairs and ranges: nested loops as NumPy operations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


def expand_counts(counts: Ints) -> tuple[Ints, Ints]:
    """Return for (N,) counts the owner and the running index of each element: (sum,) and (sum,)."""
    owner = np.repeat(np.arange(counts.size), counts)
    return owner, np.arange(owner.size) - np.repeat(np.cumsum(counts) - counts, counts)


def pairs_of_equal_label(label: Ints) -> tuple[Ints, Ints]:
    """Return the pairs of (N,) elements with the same label, each once: (P,) and (P,), the lower index first.

    Elements with a negative label have no partner.
    """
    order = np.argsort(label, kind="stable")
    order = order[int(np.searchsorted(label[order], 0)) :]
    # Each is paired with those after it in its run.
    end = np.searchsorted(label[order], label[order], side="right")
    owner, which = expand_counts(end - np.arange(order.size) - 1)
    return order[owner], order[owner + 1 + which]


def sorted_unique(values: Ints) -> Ints:
    """Return the distinct values in rising order."""
    # numpy.unique hashes first: for mostly different values sorting alone is much faster.
    values = np.sort(values)
    return np.asarray(values[np.diff(values, prepend=values[:1] - 1) != 0])
