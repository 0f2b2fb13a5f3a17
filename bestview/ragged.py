"""Ranges of different lengths, laid end to end: loops over them are NumPy's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


def ranges(
    starts: NDArray[np.int64], counts: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Lay out N ranges ``start .. start + count - 1``: (which of the N, (M,); the number, (M,)).

    >>> which, number = ranges(np.array([5, 0, 7]), np.array([2, 0, 3]))
    >>> which.tolist(), number.tolist()
    ([0, 0, 2, 2, 2], [5, 6, 7, 8, 9])
    """
    which = np.repeat(np.arange(counts.size), counts)
    ends = np.cumsum(counts)
    return which, np.arange(which.size) - np.repeat(ends - counts - starts, counts)


@dataclass(frozen=True, slots=True)
class Groups:
    """Items 0 .. N-1 in groups, to look up the items of many groups at once.

    Attributes:
        items: (N,) sorted by group, and by number within a group.
        start: (K + 1,) where each group begins in `items`.
    """

    items: NDArray[np.int64]
    start: NDArray[np.int64]

    @classmethod
    def of(cls, group: NDArray[np.int64], count: int) -> Groups:
        """Sort items into `count` groups by (N,) group numbers."""
        start = np.concatenate([[0], np.cumsum(np.bincount(group, minlength=count))])
        return cls(np.argsort(group, kind="stable"), start.astype(np.int64))

    def count(self, groups: NDArray[np.int64]) -> NDArray[np.int64]:
        """How many items each of (G,) groups has."""
        return np.asarray(self.start[groups + 1] - self.start[groups])

    def members(self, groups: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """List the items of (G,) groups: (which of the G, (M,); the item, (M,))."""
        which, at = ranges(self.start[groups], self.count(groups))
        return which, self.items[at]
