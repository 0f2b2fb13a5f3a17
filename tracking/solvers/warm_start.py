"""Warm start: the solution of one window as a guess for the next one, which shares most of its frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

UNKNOWN_STATE = -2
"""The state of an object that the warm start does not know."""


@dataclass(frozen=True, slots=True)
class ConflictPrice:
    """A binding conflict row: at most one object in `places` of `frame`, and its price."""

    frame: int
    places: tuple[int, ...]
    price: float


@dataclass(frozen=True, slots=True, eq=False)
class WarmStart:
    """A guess at a solution. Right or wrong, the solver finds the same optimum; a good guess makes it faster.

    Attributes:
        rows: conflict rows expected to bind.
        states: (n, F) expected states in the first F frames: the index of the observation, -1 if occluded, or
            `UNKNOWN_STATE`.
    """

    rows: tuple[ConflictPrice, ...]
    states: NDArray[np.int64]

    def shift(self, frames: int, objects: Sequence[int | None]) -> WarmStart:
        """Return the warm start for a window that begins `frames` later.

        `objects` maps each object of that window to its index in this one, None if it is new. The order of
        the observations must be the same.
        """
        states = np.full((len(objects), max(self.states.shape[1] - frames, 0)), UNKNOWN_STATE, dtype=np.int64)
        for n, index in enumerate(objects):
            if index is not None:
                states[n] = self.states[index, frames:]
        rows = (replace(row, frame=row.frame - frames) for row in self.rows if row.frame >= frames)
        return WarmStart(tuple(rows), states)


@dataclass(frozen=True, slots=True, eq=False)
class WindowWarmStart:
    """A window's solution as a warm start, with its frame and object ids.

    Attributes:
        first: the window's first frame.
        ids: the ids of its objects, in the order of the warm start.
        warm_start: the warm start.
    """

    first: int
    ids: Sequence[int]
    warm_start: WarmStart

    def for_window(self, first: int, ids: Sequence[int]) -> WarmStart:
        """Return the warm start for a window of the objects `ids` that begins with the frame `first`."""
        rows = {number: n for n, number in enumerate(self.ids)}
        return self.warm_start.shift(first - self.first, [rows.get(number) for number in ids])
