"""Bitmap of the frames in which each row was localized, to count frames that two rows have in common."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

_WORD = 64
"""Frames in a word."""


class LocalizedFrames:
    """One bit for each row and frame, over the newest frames.

    Args:
        frames: least number of frames that are kept.
    """

    def __init__(self, frames: int) -> None:
        self._words = frames // _WORD + 2
        self._newest = -1
        # Word n is stored in column n modulo the number of words.
        self._bits = np.zeros((0, self._words), dtype=np.uint64)

    def set_rows(self, old: Ints) -> None:
        """Replace the rows: row `i` continues what was row `old[i]`; -1: a new row."""
        bits = np.zeros((old.size, self._words), dtype=np.uint64)
        bits[old >= 0] = self._bits[old[old >= 0]]
        self._bits = bits

    def add(self, row: Ints, frame: Ints) -> None:
        """Mark (P,) rows as localized in (P,) frames."""
        if not row.size:
            return
        word = frame // _WORD
        newest = max(self._newest, int(word.max()))
        for new_word in range(max(self._newest, newest - self._words) + 1, newest + 1):
            self._bits[:, new_word % self._words] = 0
        self._newest = newest
        new = word > newest - self._words
        bit = np.left_shift(np.uint64(1), (frame[new] % _WORD).astype(np.uint64))
        np.bitwise_or.at(self._bits, (row[new], word[new] % self._words), bit)

    def merge(self, kept: Ints, lost: Ints) -> None:
        """Add the frames of (P,) rows to those of others."""
        np.bitwise_or.at(self._bits, kept, self._bits[lost])

    def count_common_frames(self, first: Ints, second: Ints, maximum: int) -> Ints:
        """Count the frames in which both rows of (P,) pairs were localized, at most `maximum`."""
        newest_first = (self._newest - np.arange(self._words)) % self._words
        bits = np.ascontiguousarray(self._bits[:, newest_first].T)
        # Number of words of each row up to the last one with a bit set.
        words = (np.arange(1, self._words + 1)[:, None] * (bits != 0)).max(axis=0, initial=0)
        total = np.zeros(first.size, dtype=np.int64)
        until = np.minimum(words[first], words[second])
        undecided = np.flatnonzero(until > 0)
        first, second, until, count = first[undecided], second[undecided], until[undecided], total[undecided]
        for word, row in enumerate(bits, start=1):
            if not undecided.size:
                break
            count += np.bitwise_count(row[first] & row[second])
            # Most pairs are decided within a few words.
            remaining = (count < maximum) & (until > word)
            if not remaining.all():
                done = ~remaining
                total[undecided[done]] = np.minimum(count[done], maximum)
                undecided, first, second = undecided[remaining], first[remaining], second[remaining]
                until, count = until[remaining], count[remaining]
        return total
