"""Scores of a view selection, relative to the offline optimum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.evaluation.ground_truth import ViewGroundTruth, optimal_views
from bestview.view_selection import NO_CAMERA, NO_VIEW_COST

_SECONDS_PER_MINUTE = 60.0
_ROUNDING = 1e-9
"""Difference of costs, in frames, below which they are equal but for the order of summation."""


@dataclass(frozen=True, slots=True)
class ViewScore:
    """Scores over all objects and all frames in which the object is visible in some camera.

    Attributes:
        frames: object-frames that count.
        agreement: share of them in which the selection equals the optimum.
        regret: extra cost over the optimum's, as a share of it (0: as good; infinite: the optimum costs 0).
        visible: share of them in which the object is visible in the chosen camera.
        chosen: share of them in which a camera is chosen.
        cuts_per_minute: cuts per minute of an object's stream.
        optimum_cuts_per_minute: the same for the optimum.
        shortest_shot: frames between the closest two cuts; 0 where there are fewer than two.
        cost: of the selection, in frames without the object; `regret` compares it with the next.
        optimum_cost: of the optimum.
    """

    frames: int
    agreement: float
    regret: float
    visible: float
    chosen: float
    cuts_per_minute: float
    optimum_cuts_per_minute: float
    shortest_shot: int
    cost: float
    optimum_cost: float


@dataclass(frozen=True, slots=True)
class _ObjectTotals:
    """Sums over the evaluated frames of one object."""

    frames: int
    agreed: int
    chosen: int
    cost: float
    best_cost: float
    visible_frames: int
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

    Frames in which no camera could show the object are left out, of the selection and of the optimum alike;
    the frames around such a gap count as neighbors. A frame without a view costs 1, and returning from it to
    the camera before is no cut.

    Args:
        cost: (K, N, C) true view cost in [0, 1] per object, frame and camera.
        visible: (K, N, C) where the object really is visible.
        views: (K, N) the selection, a camera index or -1.
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
        raise ValueError(f"views name a camera outside -1 .. {cost.shape[2] - 1}")
    truth = ViewGroundTruth(cost, visible)
    totals = [
        _object_totals(
            cost[k][evaluated], visible[k][evaluated], views[k][evaluated], optimum[evaluated], switch_cost
        )
        for k, (evaluated, optimum) in enumerate(
            zip(truth.evaluated, optimal_views(truth, switch_cost), strict=True)
        )
        if evaluated.any()
    ]
    frames = sum(item.frames for item in totals)
    per_minute = _SECONDS_PER_MINUTE * fps / max(frames, 1)
    best = sum(item.best_cost for item in totals)
    total = sum(item.cost for item in totals)
    shots = [int(np.diff(item.cuts).min()) for item in totals if item.cuts.size > 1]
    return ViewScore(
        frames=frames,
        agreement=sum(item.agreed for item in totals) / max(frames, 1),
        regret=_share(total - best, best),
        visible=sum(item.visible_frames for item in totals) / max(frames, 1),
        chosen=sum(item.chosen for item in totals) / max(frames, 1),
        cuts_per_minute=sum(item.cuts.size for item in totals) * per_minute,
        optimum_cuts_per_minute=sum(item.best_cuts.size for item in totals) * per_minute,
        shortest_shot=min(shots, default=0),
        cost=float(total),
        optimum_cost=float(best),
    )


def _object_totals(
    cost: NDArray[np.float64],
    visible: NDArray[np.bool_],
    views: NDArray[np.int64],
    best: NDArray[np.int64],
    switch_cost: float,
) -> _ObjectTotals:
    """Sum up one object's (F, C) costs, its (F,) views and the optimal ones, over its evaluated frames."""
    chosen, row = views >= 0, np.arange(len(cost))
    cuts, best_cuts = cut_frames(views), cut_frames(best)
    return _ObjectTotals(
        frames=len(cost),
        agreed=int(np.count_nonzero(views == best)),
        chosen=int(np.count_nonzero(chosen)),
        cost=float(np.where(chosen, cost[row, views], NO_VIEW_COST).sum() + switch_cost * cuts.size),
        best_cost=float(cost[row, best].sum() + switch_cost * best_cuts.size),
        visible_frames=int(np.count_nonzero(chosen & visible[row, views])),
        cuts=cuts,
        best_cuts=best_cuts,
    )


def _share(extra: float, whole: float) -> float:
    """Return `extra` as a share of `whole`; of a whole that is 0 but for rounding, 0 or infinity."""
    if whole > _ROUNDING:
        return float(extra / whole)
    return float("inf") if extra > _ROUNDING else 0.0


def cut_frames(views: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the frames at which (F,) views change the camera; frames without a view are skipped."""
    selected = np.flatnonzero(views >= 0)
    return np.asarray(selected[1:][views[selected[1:]] != views[selected[:-1]]])
