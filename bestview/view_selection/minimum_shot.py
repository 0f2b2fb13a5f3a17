"""The same program with a least shot: what is shown, and for how many GOPs it has been, is the state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestview.view_selection.dynamic_program import NO_CAMERA, NO_VIEW_COST, GopCosts


def solve_with_minimum_shot(
    gops: GopCosts,
    previous: NDArray[np.int64],
    shot_ages: NDArray[np.int64],
    switch_cost: float,
    minimum_shot_gops: int,
    decided_gops: int,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Give the cameras (asked, K) of the first GOPs, -1 where none is possible, and what all cost (K,).

    The state before a GOP is the camera shown and the age of the shot in GOPs, up to `minimum_shot_gops`.
    From that age on the camera may be left; before, only in GOPs in which it does not show the object. An
    older shot allows more, so staying never costs more than cutting to the same camera.

    Args:
        gops: with `shows_nobody`.
        previous: (K,) the camera before the window; -1: none yet.
        shot_ages: (K,) its age, 1 to `minimum_shot_gops`.
        switch_cost: of one cut.
        minimum_shot_gops: GOPs, at least 2.
        decided_gops: GOPs.
    """
    cost, count = gops.cost, len(gops.cost)
    cameras, objects = cost[0].shape
    # After GOP s, by age - 1 and camera: the least cost still to come.
    ahead = np.zeros((minimum_shot_gops, cameras, objects))
    start = np.zeros(objects)
    leaves = np.empty((decided_gops, minimum_shot_gops, cameras, objects), dtype=np.bool_)
    cut_to = np.empty((decided_gops, objects), dtype=np.int64)
    possible = np.empty((decided_gops, objects), dtype=np.bool_)
    for s in range(count - 1, -1, -1):
        fresh = cost[s] + ahead[0]
        best = np.min(fresh, axis=0)
        here = np.isfinite(best)
        older = np.concatenate([ahead[1:], ahead[-1:]])  # a shot that goes on is one GOP older after it
        stay = cost[s] + older
        leave = best + switch_cost < stay
        blind = gops.shows_nobody[s]
        if blind is not None:
            leave[:-1] &= blind
        if s < decided_gops:
            leaves[s], cut_to[s], possible[s] = leave, np.argmin(fresh, axis=0), here
        none = NO_VIEW_COST * gops.frames[s]
        ahead = np.where(here, np.where(leave, best + switch_cost, stay), older + none)
        start = np.where(here, best, start + none)
    every = np.arange(objects)
    total = np.where(previous >= 0, ahead[shot_ages - 1, previous, every], start)

    views = np.empty((decided_gops, objects), dtype=np.int64)
    current, age = previous.copy(), shot_ages.copy()
    for s in range(decided_gops):
        cut = possible[s] & ((current < 0) | leaves[s, age - 1, current, every])
        age = np.where(cut, 1, np.minimum(age + 1, minimum_shot_gops))
        current = np.where(cut, cut_to[s], current)
        views[s] = np.where(possible[s], current, NO_CAMERA)
    return views, np.asarray(total)
