"""Sparse symmetric table with an entry for few pairs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.association.index_ranges import sorted_unique

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SHIFT = 32
_LOW = (1 << _SHIFT) - 1


class SparsePairTable:
    """Values of pairs of non-negative integers ("names").

    Args:
        columns: values of each pair.

    Attributes:
        values: (P, C) of the pairs that have an entry.
    """

    def __init__(self, columns: int = 1) -> None:
        # Both names in one number, the lower one in the upper bits; sorted.
        self._code: Ints = np.zeros(0, dtype=np.int64)
        self.values: Floats = np.zeros((0, columns))

    def __len__(self) -> int:
        """Return the number of pairs with an entry."""
        return self._code.size

    @property
    def first(self) -> Ints:
        """(P,) the lower name of each pair with an entry."""
        return self._code >> _SHIFT

    @property
    def second(self) -> Ints:
        """(P,) the higher name."""
        return self._code & _LOW

    def find(self, first: Ints, second: Ints) -> Ints:
        """Return the index of the entry of each of (P,) pairs, -1: none."""
        return self._at(_codes(first, second))

    def get(self, first: Ints, second: Ints) -> Floats:
        """Return the values of (P,) pairs: (P, C), zeros for pairs without an entry."""
        index = self.find(first, second)
        values = np.zeros((index.size, self.values.shape[1]))
        values[index >= 0] = self.values[index[index >= 0]]
        return values

    def set(self, first: Ints, second: Ints, value: Floats) -> None:
        """Set the values of (P,) pairs, (P, C); each pair once."""
        code = _codes(first, second)
        order = np.argsort(code)
        code, value = code[order], value[order]
        at = self._at(code)
        new = at < 0
        self.values[at[~new]] = value[~new]
        places = np.searchsorted(self._code, code[new])
        self._code = np.insert(self._code, places, code[new])
        self.values = np.insert(self.values, places, value[new], axis=0)

    def keep(self, which: NDArray[np.bool_]) -> None:
        """Keep the entries of the mask (P,)."""
        if not which.all():
            self._code, self.values = self._code[which], self.values[which]

    def relabeled(self, first: Ints, second: Ints) -> SparsePairTable:
        """Return the table under other names, (P,) and (P,), with the sums of pairs that become one.

        Entries of a name with itself are dropped.
        """
        total = SparsePairTable(self.values.shape[1])
        first_names, second_names = unique_pairs(first, second)
        total.set(first_names, second_names, np.zeros((first_names.size, self.values.shape[1])))
        np.add.at(total.values, total.find(first, second), self.values)
        total.keep(total.first != total.second)
        return total

    def _at(self, code: Ints) -> Ints:
        if not self._code.size:
            return np.full(code.size, -1)
        at = np.searchsorted(self._code, code)
        present = at < self._code.size
        present[present] = self._code[at[present]] == code[present]
        return np.where(present, at, -1)


def _codes(one: Ints, two: Ints) -> Ints:
    return np.asarray((np.minimum(one, two) << _SHIFT) | np.maximum(one, two))


def unique_pairs(first: Ints, second: Ints) -> tuple[Ints, Ints]:
    """Return each of (P,) pairs once, the lower name first, rising."""
    pairs = sorted_unique(_codes(first, second))
    return pairs >> _SHIFT, pairs & _LOW
