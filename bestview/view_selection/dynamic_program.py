"""Dynamic programs of section III over GOPs, for all objects at once; one with a minimum shot length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

NO_CAMERA = -1
NO_VIEW_COST = 1.0
"""Cost of a frame without any view: as much as a view that does not show the object."""


@dataclass(frozen=True, slots=True, eq=False)
class GopCosts:
    """Costs of the S GOPs of a window.

    Attributes:
        cost: S times (C, K), the sum over the GOP's frames; infinite: the camera cannot be shown. Objects are
            innermost: they are the long axis, so that every step of the program is one vector operation.
        frames: (S,) float64, how many frames each GOP stands for.
        hidden: S times (C, K), where a camera does not show the object; None where it is not needed.
    """

    cost: Sequence[NDArray[np.float64]]
    frames: NDArray[np.float64]
    hidden: Sequence[NDArray[np.bool_] | None]

    def for_people(self, people: NDArray[np.int64]) -> GopCosts:
        """Return the costs of some of the people, by index."""
        hidden = [None if gop is None else gop[:, people] for gop in self.hidden]
        return GopCosts([gop[:, people] for gop in self.cost], self.frames, hidden)


def solve_dynamic_program(
    gops: GopCosts, previous: NDArray[np.int64], switch_cost: float, decided_gops: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the cameras (decided_gops, K) of the first GOPs, -1: none possible, and the window's cost (K,).

    The recursion runs backwards (cost to go), so that the decisions are read forwards and a tie can be given
    to the camera that is being shown, which the paper's forward recursion leaves open.
    """
    count, (cameras, objects) = len(gops.cost), gops.cost[0].shape
    cost_to_go = np.empty((decided_gops, cameras, objects))  # cost from GOP s on, by camera
    minimum = np.empty((count, objects))  # the least of these over the cameras
    undecided = np.empty((cameras, objects))  # the same for GOPs that are not decided
    next_cost = np.zeros((cameras, objects))  # the least cost after GOP s, by the camera shown last
    first_cost = np.zeros(objects)  # the same where no camera was shown before
    if not objects:
        return np.empty((decided_gops, 0), dtype=np.int64), first_cost
    for s in range(count - 1, -1, -1):
        value = np.add(gops.cost[s], next_cost, out=cost_to_go[s] if s < decided_gops else undecided)
        np.minimum.reduce(value, axis=0, out=minimum[s])
        if minimum[s].max() == np.inf:
            no_camera = np.isinf(minimum[s])
            no_view_cost = NO_VIEW_COST * gops.frames[s]
            next_cost = np.where(
                no_camera, next_cost + no_view_cost, np.minimum(value, minimum[s] + switch_cost)
            )
            first_cost = np.where(no_camera, first_cost + no_view_cost, minimum[s])
        else:
            np.minimum(value, minimum[s] + switch_cost, out=next_cost)
            first_cost = minimum[s]
    object_index = np.arange(objects)
    total = np.where(previous >= 0, next_cost[previous, object_index], first_cost)

    possible = np.isfinite(minimum[:decided_gops])
    leave = minimum[:decided_gops] + switch_cost
    views = np.empty((decided_gops, objects), dtype=np.int64)
    current = previous.copy()
    for s in range(decided_gops):
        stays = np.take(cost_to_go[s], np.maximum(current, 0) * objects + object_index) <= leave[s]
        cut = np.flatnonzero(possible[s] & ~(stays & (current >= 0)))
        if cut.size:
            current[cut] = np.argmin(np.take(cost_to_go[s], cut, axis=1), axis=0)
        views[s] = current
    views[~possible] = NO_CAMERA
    return views, np.asarray(total)


def solve_with_minimum_shot(
    gops: GopCosts,
    previous: NDArray[np.int64],
    shot_ages: NDArray[np.int64],
    switch_cost: float,
    minimum_shot_gops: int,
    decided_gops: int,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the cameras (decided_gops, K) of the first GOPs, -1: none possible, and the window's cost (K,).

    The state before a GOP is the camera shown and the age of the shot in GOPs, up to `minimum_shot_gops`.
    From that age on the camera may be left; before, only in GOPs in which it does not show the object. An
    older shot allows more, so staying never costs more than cutting to the same camera.

    Args:
        gops: with `hidden`.
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
        hidden = gops.hidden[s]
        if hidden is not None:
            leave[:-1] &= hidden
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
