"""A symmetric table in which only few pairs have an entry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.association.index_ranges import distinct

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SHIFT = 32
_LOW = (1 << _SHIFT) - 1


class PairTable:
    """Numbers of pairs of things that are called by whole numbers from 0.

    Args:
        columns: numbers of each pair.

    Attributes:
        value: (P, C) of the pairs that have an entry.
    """

    def __init__(self, columns: int = 1) -> None:
        # Both names in one number, the lower one in front; rising.
        self._code: Ints = np.zeros(0, dtype=np.int64)
        self.value: Floats = np.zeros((0, columns))

    def __len__(self) -> int:
        """Count the pairs that have an entry."""
        return self._code.size

    @property
    def one(self) -> Ints:
        """(P,) the lower name of each pair that has an entry."""
        return self._code >> _SHIFT

    @property
    def two(self) -> Ints:
        """(P,) the higher one."""
        return self._code & _LOW

    def find(self, one: Ints, two: Ints) -> Ints:
        """Give the entry of each of (P,) pairs, -1: it has none."""
        return self._at(_codes(one, two))

    def get(self, one: Ints, two: Ints) -> Floats:
        """Give what (P,) pairs have, (P, C); zeros where nothing."""
        at = self.find(one, two)
        found = np.zeros((at.size, self.value.shape[1]))
        found[at >= 0] = self.value[at[at >= 0]]
        return found

    def put(self, one: Ints, two: Ints, value: Floats) -> None:
        """Write what (P,) pairs have from now on, (P, C); each pair once."""
        code = _codes(one, two)
        order = np.argsort(code)
        code, value = code[order], value[order]
        at = self._at(code)
        new = at < 0
        self.value[at[~new]] = value[~new]
        places = np.searchsorted(self._code, code[new])
        self._code = np.insert(self._code, places, code[new])
        self.value = np.insert(self.value, places, value[new], axis=0)

    def keep(self, which: NDArray[np.bool_]) -> None:
        """Keep only some entries, (P,)."""
        if not which.all():
            self._code, self.value = self._code[which], self.value[which]

    def renamed(self, one: Ints, two: Ints) -> PairTable:
        """Give the table with other names, (P,) and (P,), and the sums of what is one pair then.

        A thing has no entry with itself.
        """
        total = PairTable(self.value.shape[1])
        a, b = once(one, two)
        total.put(a, b, np.zeros((a.size, self.value.shape[1])))
        np.add.at(total.value, total.find(one, two), self.value)
        total.keep(total.one != total.two)
        return total

    def _at(self, code: Ints) -> Ints:
        if not self._code.size:
            return np.full(code.size, -1)
        at = np.searchsorted(self._code, code)
        there = at < self._code.size
        there[there] = self._code[at[there]] == code[there]
        return np.where(there, at, -1)


def _codes(one: Ints, two: Ints) -> Ints:
    return np.asarray((np.minimum(one, two) << _SHIFT) | np.maximum(one, two))


def once(one: Ints, two: Ints) -> tuple[Ints, Ints]:
    """Give each of (P,) pairs once, the lower name first, rising."""
    pairs = distinct(_codes(one, two))
    return pairs >> _SHIFT, pairs & _LOW
