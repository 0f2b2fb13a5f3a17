"""What the answer of one window tells about the next one, most of whose frames are the same."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

UNKNOWN_STATE = -2
"""The state of an object of which the hint does not know where it is."""


@dataclass(frozen=True, slots=True)
class ConflictPrice:
    """A conflict row that binds: at most one object in `places` of `frame`, and what that costs."""

    frame: int
    places: tuple[int, ...]
    price: float


@dataclass(frozen=True, slots=True, eq=False)
class WarmStart:
    """A guess at an answer, right or wrong: a solver that is told reaches the same optimum, only sooner.

    Attributes:
        rows: conflict rows thought to bind.
        states: (n, F) where each object is thought to be in the first F frames: the index of its
            observation, -1 where occluded, `UNKNOWN_STATE`.
    """

    rows: tuple[ConflictPrice, ...]
    states: NDArray[np.int64]

    def shift(self, frames: int, objects: Sequence[int | None]) -> WarmStart:
        """Return the hint for a window that begins `frames` later.

        `objects` says for each object of that window which it was in this one; None: it was not.
        Observations must be numbered as they were.
        """
        states = np.full((len(objects), max(self.states.shape[1] - frames, 0)), UNKNOWN_STATE, dtype=np.int64)
        for n, was in enumerate(objects):
            if was is not None:
                states[n] = self.states[was, frames:]
        rows = (replace(row, frame=row.frame - frames) for row in self.rows if row.frame >= frames)
        return WarmStart(tuple(rows), states)


@dataclass(frozen=True, slots=True, eq=False)
class WindowWarmStart:
    """The answer of a window.

    Attributes:
        first: the window's first frame.
        ids: the numbers of its objects, in the order of the warm_start.
        warm_start: the answer.
    """

    first: int
    ids: Sequence[int]
    warm_start: WarmStart

    def for_window(self, first: int, ids: Sequence[int]) -> WarmStart:
        """Return the hint for a window of the objects `ids` that begins with the frame `first`."""
        rows = {number: n for n, number in enumerate(self.ids)}
        return self.warm_start.shift(first - self.first, [rows.get(number) for number in ids])
