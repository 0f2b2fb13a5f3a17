"""Dynamic program with a minimum shot length: the state is the camera and the age of its shot."""

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
    """Return the cameras (decided_gops, K) of the first GOPs, -1: none possible, and the total cost (K,).

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
    next_cost = np.zeros((minimum_shot_gops, cameras, objects))
    first_cost = np.zeros(objects)
    leaves = np.empty((decided_gops, minimum_shot_gops, cameras, objects), dtype=np.bool_)
    cut_to = np.empty((decided_gops, objects), dtype=np.int64)
    possible = np.empty((decided_gops, objects), dtype=np.bool_)
    for s in range(count - 1, -1, -1):
        cut_cost = cost[s] + next_cost[0]
        best = np.min(cut_cost, axis=0)
        has_camera = np.isfinite(best)
        next_age_cost = np.concatenate([next_cost[1:], next_cost[-1:]])  # a GOP older
        stay = cost[s] + next_age_cost
        leave = best + switch_cost < stay
        blind = gops.shows_nobody[s]
        if blind is not None:
            leave[:-1] &= blind
        if s < decided_gops:
            leaves[s], cut_to[s], possible[s] = leave, np.argmin(cut_cost, axis=0), has_camera
        no_view_cost = NO_VIEW_COST * gops.frames[s]
        next_cost = np.where(
            has_camera, np.where(leave, best + switch_cost, stay), next_age_cost + no_view_cost
        )
        first_cost = np.where(has_camera, best, first_cost + no_view_cost)
    object_index = np.arange(objects)
    total = np.where(previous >= 0, next_cost[shot_ages - 1, previous, object_index], first_cost)

    views = np.empty((decided_gops, objects), dtype=np.int64)
    current, age = previous.copy(), shot_ages.copy()
    for s in range(decided_gops):
        cut = possible[s] & ((current < 0) | leaves[s, age - 1, current, object_index])
        age = np.where(cut, 1, np.minimum(age + 1, minimum_shot_gops))
        current = np.where(cut, cut_to[s], current)
        views[s] = np.where(possible[s], current, NO_CAMERA)
    return views, np.asarray(total)
