"""Bitmap of the frames in which each row was localized, to count frames that two rows have in common."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

_WORD = 64
"""Frames in a word."""


class PresenceBitmap:
    """One bit for each row and frame, over the newest frames.

    Args:
        frames: least number of frames that are kept.
    """

    def __init__(self, frames: int) -> None:
        self._words = frames // _WORD + 2
        self._newest = -1
        # Word `n` of the frames is column `n` modulo their number.
        self._bits = np.zeros((0, self._words), dtype=np.uint64)

    def set_rows(self, old: Ints) -> None:
        """Replace the rows: row `i` continues what was row `old[i]`; -1: a new row."""
        bits = np.zeros((old.size, self._words), dtype=np.uint64)
        bits[old >= 0] = self._bits[old[old >= 0]]
        self._bits = bits

    def add_presence(self, row: Ints, frame: Ints) -> None:
        """Mark (P,) rows as localized in (P,) frames."""
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

    def merge(self, kept: Ints, lost: Ints) -> None:
        """Add the frames of (P,) rows to those of others."""
        np.bitwise_or.at(self._bits, kept, self._bits[lost])

    def common(self, first: Ints, second: Ints, enough: int) -> Ints:
        """Count the frames in which both rows of (P,) pairs were localized, at most `enough`."""
        newest_first = (self._newest - np.arange(self._words)) % self._words
        bits = np.ascontiguousarray(self._bits[:, newest_first].T)
        # Of each row, how many words there are up to the last one that has anything.
        words = (np.arange(1, self._words + 1)[:, None] * (bits != 0)).max(axis=0, initial=0)
        total = np.zeros(first.size, dtype=np.int64)
        until = np.minimum(words[first], words[second])
        undecided = np.flatnonzero(until > 0)
        first, second, until, count = first[undecided], second[undecided], until[undecided], total[undecided]
        for word, row in enumerate(bits, start=1):
            if not undecided.size:
                break
            count += np.bitwise_count(row[first] & row[second])
            # Nearly all are told apart, or were not there at all, within a few words.
            goes_on = (count < enough) & (until > word)
            if not goes_on.all():
                done = ~goes_on
                total[undecided[done]] = np.minimum(count[done], enough)
                undecided, first, second = undecided[goes_on], first[goes_on], second[goes_on]
                until, count = until[goes_on], count[goes_on]
        return total
