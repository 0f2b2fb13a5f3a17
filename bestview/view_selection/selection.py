"""View selection: the camera that shows each object at each frame (section III)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bestview.view_selection.dynamic_program import (
    NO_CAMERA,
    NO_VIEW_COST,
    GopCosts,
    solve_dynamic_program,
    solve_with_minimum_shot,
)


@dataclass(frozen=True, slots=True)
class ViewSelection:
    """Cameras selected for a window of N frames and K objects.

    Attributes:
        views: (K, N) int64, the camera index b_n* per object and frame; -1: no camera is possible. Fewer
            frames if fewer GOPs are decided.
        costs: (K,) float64, the cost of the whole window: the view costs, plus the switching cost for every
            cut, plus ``NO_VIEW_COST`` for every frame without a camera.
    """

    views: NDArray[np.int64]
    costs: NDArray[np.float64]


def select_views(
    cost: NDArray[np.float64],
    previous: NDArray[np.int64],
    switch_cost: float,
    cut_allowed: NDArray[np.bool_],
    minimum_shot_gops: int = 0,
    shot_ages: NDArray[np.int64] | None = None,
    weight: NDArray[np.float64] | None = None,
    decided_gops: int | None = None,
) -> ViewSelection:
    """Minimize the sum of view costs and of cuts over the window, for all objects at once (section III).

    The cost is ``sum_n c(n, b_n) + lambda * sum_n [b_n != b_(n-1)]``. A cut may only happen at a frame
    where `cut_allowed` is true (a GOP start); with all of them true this is the paper's program.

    * A camera that cannot be shown in a frame of a GOP cannot be shown in any of it. In a GOP that started
      before the window, the previous camera continues until the first frame in which it cannot be shown.
    * Where no camera is possible, the view is -1. Such a gap is no cut: continuing with the camera from
      before the gap is free. An object without a previous camera starts, for free, at the first frame where
      a cut is allowed.
    * Of equally good sequences the one that stays longest with its camera wins, and then the lowest camera
      index, so the result is the same on every machine.
    * With a minimum shot no camera is left before it was shown for that many GOPs, unless it cannot be shown
      in the GOP, or does not show the object in it (every frame costs at least ``NO_VIEW_COST``). A gap
      counts as shown.

    Fastest if the costs lie in memory as (N, C, K), objects innermost.

    Args:
        cost: (K, N, C) c(n, b) per object, frame and camera; infinite: it cannot be shown.
        previous: (K,) b_(-1), the camera index just before the window; -1: none yet.
        switch_cost: lambda, the cost of one cut, in units of one frame's view cost.
        cut_allowed: (N,) where a cut may happen; entry 0: whether frame 0 may differ from `previous`.
        minimum_shot_gops: least length of a shot in GOPs; up to 1 is the paper's program.
        shot_ages: (K,) for how many GOPs `previous` has been shown, at least 1; None: long enough to be left.
        weight: (N,) number of frames that each frame stands for, above 0; None: one. Above 1 for the last
            ones the window is extrapolated: a view that stays better is worth a cut then.
        decided_gops: for how many GOPs views are returned, at least 1; None: for all. Saves time where the
            window moves on by one GOP and later GOPs are decided again.

    Raises:
        ValueError: shapes that do not fit, a cost that is not a number, a negative switching cost, or a
            previous camera that does not exist.
    """
    _check(cost, previous, switch_cost, cut_allowed)
    objects, frames, cameras = cost.shape
    if shot_ages is not None and shot_ages.shape != (objects,):
        raise ValueError(f"shot_ages has shape {shot_ages.shape}, not ({objects},)")
    if decided_gops is not None and decided_gops < 1:
        raise ValueError(f"decided_gops is {decided_gops}, not at least 1")
    views = np.full((objects, frames), NO_CAMERA, dtype=np.int64)
    frame_weights = np.ones(frames) if weight is None else weight
    if frame_weights.shape != (frames,) or not (frame_weights > 0).all():
        raise ValueError(f"weight has shape {frame_weights.shape}, not ({frames},), or is not above 0")
    if not cameras or not frames:
        return ViewSelection(views, np.full(objects, NO_VIEW_COST * frame_weights.sum()))
    starts = np.flatnonzero(cut_allowed)
    running_frames = int(starts[0]) if starts.size else frames
    costs = (
        _continue_running_gop(cost[:, :running_frames], frame_weights[:running_frames], previous, views)
        if running_frames
        else np.zeros(objects)
    )
    if starts.size:
        gops = _sum_by_gop(cost, frame_weights, starts, mark_hidden=minimum_shot_gops > 1)
        selected, gop_costs = select_views_by_gop(
            gops, previous, switch_cost, minimum_shot_gops, shot_ages, decided_gops
        )
        lengths = np.diff(starts, append=frames)[: len(selected)]
        views = views[:, : running_frames + int(lengths.sum())]
        views[:, running_frames:] = np.repeat(selected, lengths, axis=0).T
        costs += gop_costs
    return ViewSelection(views, costs)


def select_views_by_gop(
    gops: GopCosts,
    previous: NDArray[np.int64],
    switch_cost: float,
    minimum_shot_gops: int = 0,
    shot_ages: NDArray[np.int64] | None = None,
    decided_gops: int | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Select views from the costs of whole GOPs; arguments as in `select_views`.

    Returns:
        (decided_gops, K) cameras of the first GOPs, -1: none possible, and (K,) the cost of the window.
    """
    count = len(gops.cost) if decided_gops is None else min(decided_gops, len(gops.cost))
    if minimum_shot_gops > 1:
        ages = (
            np.full(len(previous), minimum_shot_gops)
            if shot_ages is None
            else np.clip(shot_ages, 1, minimum_shot_gops)
        )
        return solve_with_minimum_shot(gops, previous, ages, switch_cost, minimum_shot_gops, count)
    return solve_dynamic_program(gops, previous, switch_cost, count)


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
    # min() is NaN if any entry is: one pass checks both.
    if cost.size and not cost.min() > -np.inf:
        raise ValueError("a view cost is not a number, or minus infinity")


def _continue_running_gop(
    cost: NDArray[np.float64],
    frame_weights: NDArray[np.float64],
    previous: NDArray[np.int64],
    views: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Fill in the GOP that started before the window, from (K, R, C) costs of its remaining frames.

    Returns:
        (K,) the cost of those views.
    """
    frames = cost.shape[1]
    previous_cost = np.take_along_axis(cost, np.maximum(previous, 0)[:, None, None], axis=2)[:, :, 0]
    continues = np.logical_and.accumulate(np.isfinite(previous_cost) & (previous >= 0)[:, None], axis=1)
    views[:, :frames] = np.where(continues, previous[:, None], NO_CAMERA)
    return np.asarray((np.where(continues, previous_cost, NO_VIEW_COST) * frame_weights).sum(axis=1))


def _sum_by_gop(
    cost: NDArray[np.float64],
    frame_weights: NDArray[np.float64],
    starts: NDArray[np.int64],
    *,
    mark_hidden: bool,
) -> GopCosts:
    """Sum the (K, N, C) costs, weighted by frame, over each GOP that starts in the window."""
    by_frame = cost.transpose(1, 2, 0)
    first = int(starts[0])
    window, starts, frame_weights = by_frame[first:], starts - first, frame_weights[first:]
    gop_costs, hidden = [], []
    for start, end in pairwise([*starts.tolist(), len(window)]):
        # Frame after frame, so that the order of the sums does not depend on how many objects there are.
        total = _weighted(window[start], frame_weights[start])
        for n in range(start + 1, end):
            total = total + _weighted(window[n], frame_weights[n])
        gop_costs.append(total)
        not_shown = window[start:end].min(axis=0) >= NO_VIEW_COST if mark_hidden else None
        hidden.append(None if not_shown is None else not_shown | np.isinf(total))
    return GopCosts(gop_costs, np.add.reduceat(frame_weights, starts), hidden)


def _weighted(cost: NDArray[np.float64], frames: float) -> NDArray[np.float64]:
    return cost if frames == 1 else cost * frames
