"""How good are given view choices, beside the best that could have been made knowing everything."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.choice import NO_CAMERA, NO_VIEW_COST, choose_views

_SECONDS_PER_MINUTE = 60.0


@dataclass(frozen=True, slots=True)
class ViewScore:
    """Scores over all objects and all frames in which the object is visible in some camera.

    Attributes:
        frames: object-frames that count.
        agreement: share of them in which the choice is the optimum's.
        regret: extra cost over the optimum's, as a share of it (0: as good; infinite: the optimum is free).
        visible: share of them in which the object is visible in the chosen camera.
        cuts_per_minute: cuts per minute of an object's stream.
        optimum_cuts_per_minute: the same for the optimum.
        shortest_shot: frames between the closest two cuts; 0 where there are fewer than two.
    """

    frames: int
    agreement: float
    regret: float
    visible: float
    cuts_per_minute: float
    optimum_cuts_per_minute: float
    shortest_shot: int


@dataclass(frozen=True, slots=True)
class _Tally:
    """Sums over the frames of one object that count."""

    frames: int
    agreed: int
    cost: float
    best_cost: float
    seen: int
    cuts: NDArray[np.int64]
    best_cuts: NDArray[np.int64]


def score_views(
    cost: NDArray[np.float64],
    visible: NDArray[np.bool_],
    views: NDArray[np.int64],
    switch_cost: float,
    fps: float,
) -> ViewScore:
    """Score `views` against the exact offline optimum of section III over the whole recording.

    Frames in which nobody could show the object are left out, of the choice and of the optimum alike;
    the frames around such a gap are taken as neighbours. A frame without a choice costs 1, and no cut
    is counted to it or from it to the camera before.

    Args:
        cost: (K, N, C) true view cost in [0, 1] per object, frame and camera.
        visible: (K, N, C) where the object really is visible.
        views: (K, N) the choice, a camera index or -1.
        switch_cost: lambda, cost of a cut in units of one frame's view cost.
        fps: frames per second.

    Raises:
        ValueError: shapes that do not fit, or a camera that does not exist.
    """
    if cost.ndim != 3 or visible.shape != cost.shape or views.shape != cost.shape[:2]:  # noqa: PLR2004 — K, N, C
        raise ValueError(
            f"shapes do not fit: cost {cost.shape}, visible {visible.shape}, views {views.shape}"
        )
    if views.size and not (views.min() >= NO_CAMERA and views.max() < cost.shape[2]):
        raise ValueError(f"the choice names a camera outside -1 .. {cost.shape[2] - 1}")
    counted = np.asarray(visible.any(axis=2))
    tallies = [
        _tally(cost[k][counted[k]], visible[k][counted[k]], views[k][counted[k]], switch_cost)
        for k in range(len(cost))
        if counted[k].any()
    ]
    frames = sum(tally.frames for tally in tallies)
    per_minute = _SECONDS_PER_MINUTE * fps / max(frames, 1)
    best = sum(tally.best_cost for tally in tallies)
    extra = sum(tally.cost for tally in tallies) - best
    shots = [int(np.diff(tally.cuts).min()) for tally in tallies if tally.cuts.size > 1]
    return ViewScore(
        frames=frames,
        agreement=sum(tally.agreed for tally in tallies) / max(frames, 1),
        regret=extra / best if best > 0 else (float("inf") if extra > 0 else 0.0),
        visible=sum(tally.seen for tally in tallies) / max(frames, 1),
        cuts_per_minute=sum(tally.cuts.size for tally in tallies) * per_minute,
        optimum_cuts_per_minute=sum(tally.best_cuts.size for tally in tallies) * per_minute,
        shortest_shot=min(shots, default=0),
    )


def _tally(
    cost: NDArray[np.float64], visible: NDArray[np.bool_], views: NDArray[np.int64], switch_cost: float
) -> _Tally:
    """Sum up one object's (F, C) costs and (F,) views, all of whose frames count."""
    frames = len(cost)
    best = choose_views(cost[None], np.array([NO_CAMERA]), switch_cost, np.ones(frames, dtype=bool))
    chosen = views >= 0
    row = np.arange(frames)
    each = np.where(chosen, cost[row, views], NO_VIEW_COST)
    cuts = _cuts(views)
    return _Tally(
        frames=frames,
        agreed=int(np.count_nonzero(views == best.views[0])),
        cost=float(each.sum() + switch_cost * cuts.size),
        best_cost=float(best.costs[0]),
        seen=int(np.count_nonzero(chosen & visible[row, views])),
        cuts=cuts,
        best_cuts=_cuts(best.views[0]),
    )


def _cuts(views: NDArray[np.int64]) -> NDArray[np.int64]:
    """Frames at which (F,) views change the camera; frames without a choice do not."""
    shown = np.flatnonzero(views >= 0)
    return np.asarray(shown[1:][views[shown[1:]] != views[shown[:-1]]])
