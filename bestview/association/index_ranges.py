"""Pairs and runs written out as index arrays: loops that NumPy can walk."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


def written_out(counts: Ints) -> tuple[Ints, Ints]:
    """Give for (N,) counts, one after the other, whose each is and which of theirs: (sum,) and (sum,)."""
    owner = np.repeat(np.arange(counts.size), counts)
    return owner, np.arange(owner.size) - np.repeat(np.cumsum(counts) - counts, counts)


def pairs_within(label: Ints) -> tuple[Ints, Ints]:
    """Give the pairs of (N,) things that have the same label, each once: (P,) and (P,), the lower one first.

    A label below 0 is nobody's.
    """
    order = np.argsort(label, kind="stable")
    order = order[int(np.searchsorted(label[order], 0)) :]
    # Each is paired with those after it in its run.
    end = np.searchsorted(label[order], label[order], side="right")
    owner, which = written_out(end - np.arange(order.size) - 1)
    return order[owner], order[owner + 1 + which]


def distinct(values: Ints) -> Ints:
    """Give the values that occur, each once, rising."""
    # numpy.unique hashes first: for mostly different values sorting alone is much faster.
    values = np.sort(values)
    return np.asarray(values[np.diff(values, prepend=values[:1] - 1) != 0])
