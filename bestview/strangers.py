"""What is known about tracks that never came near each other: nothing but how often both were seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MIN_COMMON_FRAMES = 3
"""Frames in which two tracks must both be seen before their places are compared."""

_STEPS = 2.0**20
"""Steps per unit of evidence."""


def exact(evidence: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round to steps so coarse that sums of evidence are exact: they may be added in any order then."""
    return np.asarray(np.round(evidence * _STEPS) / _STEPS)


def counted(
    before: NDArray[np.float64], score: NDArray[np.float64], memory: float, cap: float
) -> NDArray[np.float64]:
    """Evidence after one more score: ``clip(memory * before + score, -cap, cap)``."""
    return exact(np.clip(memory * before + score, -cap, cap))


class Strangers:
    """Who was seen on the ground in which updates.

    Two tracks far apart get the worst score in every update in which both are seen. That need not be
    written down pair by pair, which would be the square of the tracks: it follows from how many such
    updates there were, of those that ended within `remember` frames.

    Args:
        worst: that score.
        memory: share of evidence that lives on.
        cap: the most evidence there is.
        remember: frames.
    """

    def __init__(self, worst: float, memory: float, cap: float, remember: int) -> None:
        self._worst, self._memory, self._cap, self._remember = worst, memory, cap, remember
        self._ends: list[int] = []
        self._seen: NDArray[np.uint8] = np.zeros((0, 0, 1), dtype=np.uint8)
        self._levels = [0.0]

    @property
    def levels(self) -> NDArray[np.float64]:
        """All evidence there can be by now, by the number of updates, (n,)."""
        while len(self._levels) <= len(self._ends):
            last, worst = np.array([self._levels[-1]]), np.array([self._worst])
            self._levels.append(float(counted(last, worst, self._memory, self._cap)[0]))
        return np.array(self._levels)

    def follow(self, size: int, new: NDArray[np.int64], old: NDArray[np.int64]) -> None:
        """Make room for `size` tracks; what was row `old[i]` is row `new[i]`."""
        seen = np.zeros((size, *self._seen.shape[1:]), dtype=np.uint8)
        seen[new] = self._seen[old]
        self._seen = seen

    def see(self, last_frame: int, rows: NDArray[np.int64], known: NDArray[np.bool_]) -> None:
        """Take in the update that ends with `last_frame`: (S, W) in which frames tracks stood somewhere."""
        bits = np.packbits(known, axis=1)
        fresh = sum(end > last_frame - self._remember for end in self._ends)
        kept = self._seen[:, len(self._ends) - fresh :]
        width = max(kept.shape[2], bits.shape[1])
        seen = np.zeros((kept.shape[0], fresh + 1, width), dtype=np.uint8)
        seen[:, :fresh, : kept.shape[2]] = kept
        seen[rows, fresh, : bits.shape[1]] = bits
        self._seen = seen
        self._ends = [*self._ends[len(self._ends) - fresh :], last_frame]

    def evidence(self, one: NDArray[np.int64], two: NDArray[np.int64]) -> NDArray[np.float64]:
        """What speaks against (P,) pairs of tracks of different cameras that never came near: (P,)."""
        if not one.size or not self._ends:
            return np.zeros(one.shape)
        common = np.bitwise_count(self._seen[one] & self._seen[two]).sum(axis=2, dtype=np.int64)
        return np.asarray(self.levels[(common >= MIN_COMMON_FRAMES).sum(axis=1)])
