"""Who was once seen side by side in one camera: two people, for ever."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class _Tables:
    """One square table for each camera over its tracks in play, all in one flat array.

    Attributes:
        camera: (T,) of each track, rising.
        start: (C + 1,) first track of each camera.
        offset: (C + 1,) where its table begins.
        flat: the tables.
    """

    camera: NDArray[np.int64]
    start: NDArray[np.int64]
    offset: NDArray[np.int64]
    flat: NDArray[np.bool_]

    @classmethod
    def empty(cls, camera: NDArray[np.int64]) -> _Tables:
        size = np.bincount(camera)
        start, offset = (np.concatenate([[0], np.cumsum(n)]).astype(np.int64) for n in (size, size**2))
        return cls(camera, start, offset, np.zeros(int(offset[-1]), dtype=np.bool_))

    def table(self, camera: int) -> NDArray[np.bool_]:
        size = int(self.start[camera + 1] - self.start[camera])
        return self.flat[self.offset[camera] : self.offset[camera + 1]].reshape(size, size)


class Rivals:
    """Remembers pairs of one camera's tracks; tracks are rows 0 .. T-1, sorted by camera."""

    def __init__(self) -> None:
        self._tables = _Tables.empty(np.zeros(0, dtype=np.int64))

    def follow(self, camera: NDArray[np.int64], new: NDArray[np.int64], old: NDArray[np.int64]) -> None:
        """Take over (T,) the cameras of the tracks, rising; what was row `old[i]` is row `new[i]`."""
        before, after = self._tables, _Tables.empty(camera)
        ends = np.searchsorted(camera[new], np.arange(after.start.size))
        for c in np.unique(camera[new]).tolist():
            kept = slice(ends[c], ends[c + 1])
            to, come = new[kept] - after.start[c], old[kept] - before.start[c]
            after.table(c)[to[:, None], to] = before.table(c)[come[:, None], come]
        self._tables = after

    def add(self, rows: NDArray[np.int64], side_by_side: NDArray[np.bool_]) -> None:
        """Note who of one camera's tracks, (N,) rows, was seen with whom: (N, N)."""
        if rows.size:
            camera = int(self._tables.camera[rows[0]])
            at = rows - self._tables.start[camera]
            self._tables.table(camera)[at[:, None], at] |= side_by_side

    def between(self, one: NDArray[np.int64], two: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Say of (P,) pairs of tracks whether they are rivals: (P,)."""
        t = self._tables
        camera = t.camera[one]
        same = camera == t.camera[two]
        first = t.start[camera]
        at = t.offset[camera] + (one - first) * (t.start[camera + 1] - first) + (two - first)
        return np.asarray(same & t.flat[np.where(same, at, 0)])

    def any_between(self, ones: NDArray[np.int64], others: NDArray[np.int64]) -> bool:
        """Say whether any of some tracks is a rival of any of others."""
        return bool(self.between(np.repeat(ones, others.size), np.tile(others, ones.size)).any())
