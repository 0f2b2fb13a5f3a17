"""The dynamic program of section III over GOPs, for all objects at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

NO_CAMERA = -1
NO_VIEW_COST = 1.0
"""What a frame costs in which no camera can be shown: as much as a view of nobody."""


@dataclass(frozen=True, slots=True, eq=False)
class GopCosts:
    """What the S GOPs of a window cost.

    Attributes:
        cost: S times (C, K), the sum over the GOP's frames; infinite where a camera cannot be shown. Objects
            are innermost: they are the long axis, so that every step of the program is one vector operation.
        frames: (S,) float64, how many frames each GOP stands for.
        shows_nobody: S times (C, K), where a camera shows nobody, or cannot be shown; None where nobody asks.
    """

    cost: Sequence[NDArray[np.float64]]
    frames: NDArray[np.float64]
    shows_nobody: Sequence[NDArray[np.bool_] | None]

    def for_people(self, people: NDArray[np.int64]) -> GopCosts:
        """Give the same for some of the people, by index."""
        blind = [None if it is None else it[:, people] for it in self.shows_nobody]
        return GopCosts([it[:, people] for it in self.cost], self.frames, blind)


def solve_dynamic_program(
    gops: GopCosts, previous: NDArray[np.int64], switch_cost: float, decided_gops: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Give the cameras (asked, K) of the first GOPs, -1 where none is possible, and what all cost (K,).

    The recursion runs backwards (cost still to come), so that the decisions are read forwards and a tie
    can be given to the camera that is being shown, which the paper's forward recursion leaves open.
    """
    count, (cameras, objects) = len(gops.cost), gops.cost[0].shape
    onward = np.empty((decided_gops, cameras, objects))  # the cost from GOP s on, by the camera shown in it
    best = np.empty((count, objects))  # the least of these over the cameras
    later = np.empty((cameras, objects))  # the same for GOPs that nobody asks for
    ahead = np.zeros((cameras, objects))  # the least cost after GOP s, by the camera shown last
    start = np.zeros(objects)  # the same where no camera was shown before
    if not objects:
        return np.empty((decided_gops, 0), dtype=np.int64), start
    for s in range(count - 1, -1, -1):
        value = np.add(gops.cost[s], ahead, out=onward[s] if s < decided_gops else later)
        np.minimum.reduce(value, axis=0, out=best[s])
        if best[s].max() == np.inf:
            hole = np.isinf(best[s])
            none = NO_VIEW_COST * gops.frames[s]
            ahead = np.where(hole, ahead + none, np.minimum(value, best[s] + switch_cost))
            start = np.where(hole, start + none, best[s])
        else:
            np.minimum(value, best[s] + switch_cost, out=ahead)
            start = best[s]
    every = np.arange(objects)
    total = np.where(previous >= 0, ahead[previous, every], start)

    possible = np.isfinite(best[:decided_gops])
    leave = best[:decided_gops] + switch_cost
    views = np.empty((decided_gops, objects), dtype=np.int64)
    current = previous.copy()
    for s in range(decided_gops):
        goes_on = np.take(onward[s], np.maximum(current, 0) * objects + every) <= leave[s]
        cut = np.flatnonzero(possible[s] & ~(goes_on & (current >= 0)))
        if cut.size:
            current[cut] = np.argmin(np.take(onward[s], cut, axis=1), axis=0)
        views[s] = current
    views[~possible] = NO_CAMERA
    return views, np.asarray(total)
