"""The same program with a least shot: what is shown, and for how many GOPs it has been, is the state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.view_selection.dynamic_program import NO_CAMERA, NO_VIEW_COST, Gops


def solve_with_shots(
    gops: Gops,
    previous: NDArray[np.int64],
    held: NDArray[np.int64],
    switch_cost: float,
    least_shot: int,
    asked: int,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Give the cameras (asked, K) of the first GOPs, -1 where none is possible, and what all cost (K,).

    The state before a GOP is the camera shown and its age: for how many GOPs it has been shown, counted up to
    `least_shot`, when it may be left. Before that it may be left only where it is blind. The older a shot,
    the freer the choice, so to stay never costs more than to cut to the same camera.

    Args:
        gops: with `blind`.
        previous: (K,) the camera before the window; -1: none yet.
        held: (K,) its age, 1 to `least_shot`.
        switch_cost: of one cut.
        least_shot: GOPs, at least 2.
        asked: GOPs.
    """
    cost, count = gops.cost, len(gops.cost)
    cameras, objects = cost[0].shape
    # After GOP s, by age - 1 and camera: the least cost still to come.
    ahead = np.zeros((least_shot, cameras, objects))
    start = np.zeros(objects)
    leaves = np.empty((asked, least_shot, cameras, objects), dtype=np.bool_)
    cut_to = np.empty((asked, objects), dtype=np.int64)
    possible = np.empty((asked, objects), dtype=np.bool_)
    for s in range(count - 1, -1, -1):
        fresh = cost[s] + ahead[0]
        best = np.min(fresh, axis=0)
        here = np.isfinite(best)
        older = np.concatenate([ahead[1:], ahead[-1:]])  # a shot that goes on is one GOP older after it
        stay = cost[s] + older
        leave = best + switch_cost < stay
        blind = gops.blind[s]
        if blind is not None:
            leave[:-1] &= blind
        if s < asked:
            leaves[s], cut_to[s], possible[s] = leave, np.argmin(fresh, axis=0), here
        none = NO_VIEW_COST * gops.frames[s]
        ahead = np.where(here, np.where(leave, best + switch_cost, stay), older + none)
        start = np.where(here, best, start + none)
    every = np.arange(objects)
    total = np.where(previous >= 0, ahead[held - 1, previous, every], start)

    views = np.empty((asked, objects), dtype=np.int64)
    current, age = previous.copy(), held.copy()
    for s in range(asked):
        cut = possible[s] & ((current < 0) | leaves[s, age - 1, current, every])
        age = np.where(cut, 1, np.minimum(age + 1, least_shot))
        current = np.where(cut, cut_to[s], current)
        views[s] = np.where(possible[s], current, NO_CAMERA)
    return views, np.asarray(total)
