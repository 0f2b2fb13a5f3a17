"""Which camera shows each object at each frame: the sliding-window dynamic program of section III."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

NO_CAMERA = -1
NO_VIEW_COST = 1.0
"""What a frame costs in which no camera can be shown: as much as a view of nobody."""


@dataclass(frozen=True, slots=True)
class Choices:
    """The cameras chosen for a window of N frames and K objects.

    Attributes:
        views: (K, N) int64, the camera index b_n* per object and frame; -1 where no camera is possible.
        costs: (K,) float64, the cost of those views: the view costs, plus the switching cost for every
            cut, plus ``NO_VIEW_COST`` for every frame without a camera.
    """

    views: NDArray[np.int64]
    costs: NDArray[np.float64]


def choose_views(
    cost: NDArray[np.float64],
    previous: NDArray[np.int64],
    switch_cost: float,
    cut_allowed: NDArray[np.bool_],
) -> Choices:
    """Minimise the sum of view costs and of cuts over the window, for all objects at once (section III).

    The cost is ``sum_n c(n, b_n) + lambda * sum_n [b_n != b_(n-1)]``. A cut may only happen at a frame
    where `cut_allowed` is true (a GOP start); with all of them true this is the paper's program.

    * A camera that cannot be shown somewhere in a GOP cannot be shown in any of it. In a GOP that has
      begun before the window, where there is nothing left to choose, the previous camera goes on until
      the first frame in which it cannot be shown.
    * Where no camera is possible, the view is -1. Such a hole is no cut: going on with the camera
      from before the hole is free. An object without a previous camera starts, for free, at the
      first frame where a cut is allowed.
    * Between equally good sequences the one that stays longest with its camera wins, and then the
      lowest camera index. There are no other ties, so the answer is the same on every machine.

    Args:
        cost: (K, N, C) c(n, b) per object, frame and camera; infinite where it cannot be shown.
        previous: (K,) b_(-1), the camera index just before the window; -1: none yet.
        switch_cost: lambda, the cost of one cut, in units of one frame's view cost.
        cut_allowed: (N,) where a cut may happen; entry 0 says whether frame 0 may differ from `previous`.

    Raises:
        ValueError: shapes that do not fit, a cost that is not a number, a negative switching cost, or a
            previous camera that does not exist.
    """
    _check(cost, previous, switch_cost, cut_allowed)
    objects, frames = cost.shape[:2]
    views = np.full((objects, frames), NO_CAMERA, dtype=np.int64)
    if cost.size:
        starts = np.flatnonzero(cut_allowed)
        running = int(starts[0]) if starts.size else frames
        if running:
            _go_on(cost[:, :running], previous, views)
        if starts.size:
            _decide(_gop_costs(cost, starts), starts, previous, switch_cost, views)
    return Choices(views, _total(cost, views, previous, switch_cost))


def _check(
    cost: NDArray[np.float64],
    previous: NDArray[np.int64],
    switch_cost: float,
    cut_allowed: NDArray[np.bool_],
) -> None:
    if cost.ndim != 3:  # noqa: PLR2004 — objects, frames, cameras
        raise ValueError(f"cost has shape {cost.shape}, not (objects, frames, cameras)")
    objects, frames, cameras = cost.shape
    if previous.shape != (objects,):
        raise ValueError(f"previous has shape {previous.shape}, not ({objects},)")
    if cut_allowed.shape != (frames,):
        raise ValueError(f"cut_allowed has shape {cut_allowed.shape}, not ({frames},)")
    if previous.size and not (previous.min() >= NO_CAMERA and previous.max() < cameras):
        raise ValueError(f"previous names a camera outside -1 .. {cameras - 1}")
    if not 0 <= switch_cost < np.inf:
        raise ValueError(f"the switching cost is {switch_cost}, not a number >= 0")
    # min() is NaN when any entry is: one pass finds both defects.
    if cost.size and not cost.min() > -np.inf:
        raise ValueError("a view cost is not a number, or minus infinity")


def _go_on(cost: NDArray[np.float64], previous: NDArray[np.int64], views: NDArray[np.int64]) -> None:
    """Fill in the GOP that began before the window: (K, R, C) costs of its rest; no choice is left."""
    running = cost.shape[1]
    mine = np.take_along_axis(cost, np.maximum(previous, 0)[:, None, None], axis=2)[:, :, 0]
    shown = np.logical_and.accumulate(np.isfinite(mine), axis=1)
    views[:, :running] = np.where(shown, previous[:, None], NO_CAMERA)


def _gop_costs(cost: NDArray[np.float64], starts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Sum the (K, N, C) costs over each GOP that starts in the window: (S, C, K), objects innermost.

    Objects are the long axis: with it innermost every step of the program is one vector operation.
    """
    by_frame = cost.transpose(1, 2, 0)
    if starts.size == cost.shape[1]:
        return np.array(by_frame, order="C")  # a copy, always: the program works in it
    return np.ascontiguousarray(np.add.reduceat(by_frame, starts, axis=0))


def _decide(
    cost: NDArray[np.float64],
    starts: NDArray[np.int64],
    previous: NDArray[np.int64],
    switch_cost: float,
    views: NDArray[np.int64],
) -> None:
    """Solve the program over the (S, C, K) GOP costs and write the cameras into `views`.

    The recursion runs backwards (cost still to come), so that the decisions are read forwards and a tie
    can be given to the camera that is being shown, which the paper's forward recursion leaves open.
    """
    gops, cameras, objects = cost.shape
    best = np.empty((gops, objects))  # the least cost from GOP s on, over the cameras to show in it
    ahead = np.zeros((cameras, objects))  # the least cost after GOP s, by the camera shown last
    for s in range(gops - 1, -1, -1):
        value = cost[s]
        value += ahead  # in place: from here on cost[s] is the cost from GOP s on
        np.min(value, axis=0, out=best[s])
        after = np.minimum(value, best[s] + switch_cost)
        hole = np.isinf(best[s])
        ahead = np.where(hole, ahead, after) if hole.any() else after

    possible = np.isfinite(best)
    leave = best + switch_cost
    ends = np.append(starts[1:], views.shape[1])
    every = np.arange(objects)
    current = previous.copy()
    for s in range(gops):
        going_on = (current >= 0) & (cost[s][current, every] <= leave[s])
        cut = np.flatnonzero(possible[s] & ~going_on)
        if cut.size:
            current[cut] = np.argmin(cost[s][:, cut], axis=0)
        views[:, starts[s] : ends[s]] = np.where(possible[s], current, NO_CAMERA)[:, None]


def _total(
    cost: NDArray[np.float64],
    views: NDArray[np.int64],
    previous: NDArray[np.int64],
    switch_cost: float,
) -> NDArray[np.float64]:
    """Cost of the given views, per object: (K,)."""
    if not cost.size:
        return np.full(cost.shape[0], NO_VIEW_COST * cost.shape[1])
    objects, frames, cameras = cost.shape
    # A hole repeats the camera before it, so that it never counts as a cut.
    last = np.concatenate([previous[:, None], views], axis=1)
    holes = views < 0
    if holes.any():
        position = np.where(last >= 0, np.arange(frames + 1), 0)
        last = np.take_along_axis(last, np.maximum.accumulate(position, axis=1), axis=1)
    cuts = np.count_nonzero((last[:, 1:] != last[:, :-1]) & (last[:, :-1] >= 0), axis=1)
    each = cost.reshape(-1, cameras)[np.arange(objects * frames), views.ravel()].reshape(objects, frames)
    each[holes] = NO_VIEW_COST
    return np.asarray(each.sum(axis=1) + switch_cost * cuts)
