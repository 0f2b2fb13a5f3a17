"""What is known about pairs of episodes and people: tables that follow who is in play.

The rows are the open episodes, then the people who have settled ones, in the order in which others list
them. Evidence is summed up as it comes in: a pair is never looked at again.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bestview.keys import EpisodeKey

Floats = NDArray[np.float64]

_LEAST_COMMON = 3
"""Frames in which two must both be seen before their places say anything."""


_T = TypeVar("_T", bound=np.generic)

Row = EpisodeKey | int
"""An open episode, or the number of a person who has settled ones."""


class PairTables:
    """Symmetric tables over N rows.

    Attributes:
        apart: (N, N) seen at once in one camera: two people.
        alike: (N, N) evidence of looks between cameras without a common ground.
    """

    def __init__(self) -> None:
        self._rows: list[Row] = []
        self._place: dict[Row, int] = {}
        self.apart: NDArray[np.bool_] = np.zeros((0, 0), dtype=np.bool_)
        self.alike: Floats = np.zeros((0, 0))
        self._near: Floats = np.zeros((0, 0))
        # In how many frames both were seen; no more than says anything.
        self._common: NDArray[np.uint8] = np.zeros((0, 0), dtype=np.uint8)

    @property
    def near(self) -> Floats:
        """(N, N) evidence of standing on the same ground."""
        return np.asarray(np.where(self._common >= _LEAST_COMMON, self._near, 0.0))

    def arrange(self, rows: Sequence[Row]) -> None:
        """Go over to these rows: those that were here keep what is known about them."""
        if rows == self._rows:
            return
        old = np.array([self._place.get(row, -1) for row in rows], dtype=np.int64)
        self.apart, self._common = _moved(self.apart, old), _moved(self._common, old)
        self.alike, self._near = _moved(self.alike, old), _moved(self._near, old)
        self._rows = list(rows)
        self._place = {row: i for i, row in enumerate(rows)}

    def make_room(self, rows: Iterable[Row]) -> None:
        """Add those of these rows that are not here yet; nothing is known about them."""
        new = [row for row in dict.fromkeys(rows) if row not in self._place]
        self.arrange([*self._rows, *new])

    def absorb(self, kept: Row, lost: Row) -> None:
        """Add what is known about one row to another: the two are one."""
        if lost not in self._place:
            return
        one, two = self._place[kept], self._place[lost]
        self.apart[one] |= self.apart[two]
        self.apart[:, one] |= self.apart[:, two]
        for table in (self.alike, self._near):
            table[one] += table[two]
            table[:, one] += table[:, two]
        np.maximum(self._common[one], self._common[two], out=self._common[one])
        self._common[:, one] = self._common[one]
        self.apart[one, one] = False

    def add_apart(self, one: NDArray[np.int64], two: NDArray[np.int64]) -> None:
        """Note (P,) pairs of rows that were seen at once in one camera."""
        self.apart[one, two] = self.apart[two, one] = True

    def add_near(
        self,
        one: NDArray[np.int64],
        two: NDArray[np.int64],
        evidence: Floats,
        frames: NDArray[np.int64],
        cap: float,
    ) -> None:
        """Add what some frames say about how near (P,) pairs of rows stand.

        The sum stays within `cap`: what was said long ago can be taken back.
        """
        low, high = np.minimum(one, two), np.maximum(one, two)
        np.add.at(self._near, (low, high), evidence)
        near = np.clip(self._near[low, high], -cap, cap)
        common = np.minimum(self._common[low, high] + frames, _LEAST_COMMON)
        self._near[low, high] = self._near[high, low] = near
        self._common[low, high] = self._common[high, low] = common

    def add_alike(
        self, one: NDArray[np.int64], two: NDArray[np.int64], score: Floats, memory: float, cap: float
    ) -> None:
        """Add what an update says about the looks of (P,) pairs of rows, each pair once."""
        value = np.clip(memory * self.alike[one, two] + score, -cap, cap)
        self.alike[one, two] = self.alike[two, one] = value


_FEW = 8
"""Runs of rows up to which whole blocks are copied: much faster than single cells."""


def _moved(table: NDArray[_T], old: NDArray[np.int64]) -> NDArray[_T]:
    """Give a table whose row and column `i` are what `old[i]` was, -1: nothing, zeros."""
    fresh = np.zeros((old.size, old.size), dtype=table.dtype)
    kept = np.flatnonzero(old >= 0)
    breaks = np.flatnonzero((np.diff(kept) != 1) | (np.diff(old[kept]) != 1)) + 1
    if breaks.size >= _FEW:
        fresh[np.ix_(kept, kept)] = table[np.ix_(old[kept], old[kept])]
        return fresh
    runs = [(run[0], old[run[0]], run.size) for run in np.split(kept, breaks) if run.size]
    for i, a, high in runs:
        for j, b, wide in runs:
            fresh[i : i + high, j : j + wide] = table[a : a + high, b : b + wide]
    return fresh
