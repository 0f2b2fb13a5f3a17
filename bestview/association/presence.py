"""In which of the last frames each row stood somewhere: who was about at the same time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

_WORD = 64
"""Frames in a word."""


class Presence:
    """A bit for each row and frame, of the newest frames.

    Args:
        frames: that are remembered, at least.
    """

    def __init__(self, frames: int) -> None:
        self._words = frames // _WORD + 2
        self._newest = -1
        # Word `n` of the frames is column `n` modulo their number.
        self._bits = np.zeros((0, self._words), dtype=np.uint64)

    def arrange(self, old: Ints) -> None:
        """Go over to rows of which `i` is what `old[i]` was; -1: a new one."""
        bits = np.zeros((old.size, self._words), dtype=np.uint64)
        bits[old >= 0] = self._bits[old[old >= 0]]
        self._bits = bits

    def stand(self, row: Ints, frame: Ints) -> None:
        """Note that (P,) rows stood somewhere in (P,) frames."""
        if not row.size:
            return
        word = frame // _WORD
        newest = max(self._newest, int(word.max()))
        for begun in range(max(self._newest, newest - self._words) + 1, newest + 1):
            self._bits[:, begun % self._words] = 0
        self._newest = newest
        new = word > newest - self._words
        bit = np.left_shift(np.uint64(1), (frame[new] % _WORD).astype(np.uint64))
        np.bitwise_or.at(self._bits, (row[new], word[new] % self._words), bit)

    def absorb(self, kept: Ints, lost: Ints) -> None:
        """Count the frames of (P,) rows as others' as well."""
        np.bitwise_or.at(self._bits, kept, self._bits[lost])

    def common(self, one: Ints, two: Ints, enough: int) -> Ints:
        """In how many frames both of (P,) pairs of rows stood somewhere; `enough`: so many or more."""
        newest_first = (self._newest - np.arange(self._words)) % self._words
        bits = np.ascontiguousarray(self._bits[:, newest_first].T)
        # Of each row, how many words there are up to the last one that has anything.
        words = (np.arange(1, self._words + 1)[:, None] * (bits != 0)).max(axis=0, initial=0)
        total = np.zeros(one.size, dtype=np.int64)
        until = np.minimum(words[one], words[two])
        left = np.flatnonzero(until > 0)
        one, two, until, count = one[left], two[left], until[left], total[left]
        for word, row in enumerate(bits, start=1):
            if not left.size:
                break
            count += np.bitwise_count(row[one] & row[two])
            # Nearly all are told apart, or were not there at all, within a few words.
            goes_on = (count < enough) & (until > word)
            if not goes_on.all():
                done = ~goes_on
                total[left[done]] = np.minimum(count[done], enough)
                left, one, two = left[goes_on], one[goes_on], two[goes_on]
                until, count = until[goes_on], count[goes_on]
        return total
