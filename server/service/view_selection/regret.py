"""The regret of the views that viewers of each delay are shown, beside the best ones in hindsight."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview import NO_CAMERA, NO_VIEW_COST
from server.service.view_selection.delay_modes import DelayMode, FinalCosts, ModeDecision

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_WINDOW_S = 300.0
"""Seconds over which the regret is averaged."""
_MINUTE_S = 60.0
_PENDING_GOPS = 256
"""Decisions that may wait for their GOP's final costs, and the other way around."""


@dataclass(frozen=True, slots=True)
class ModeScore:
    """How well the views of one delay were selected, over the last minutes.

    Attributes:
        regret_s: the cost beyond that of the best views in hindsight, cuts included: seconds of not seeing
            the person, per minute of a person whom some camera sees.
        cuts_per_minute: of one person's stream, on average.
    """

    regret_s: float
    cuts_per_minute: float


@dataclass(frozen=True, slots=True)
class _GopScore:
    excess: float
    cuts: int
    person_frames: int


@dataclass(frozen=True, slots=True, eq=False)
class _Hindsight:
    """One GOP's final costs, and by how much it raised the cost of each person's best views (K,)."""

    final: FinalCosts
    optimum: Floats


@dataclass(slots=True)
class _Work:
    """The least cost of all views so far that end with each camera, (C, K): the paper's forward recursion."""

    numbers: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    cost: Floats = field(default_factory=lambda: np.zeros((0, 0)))


class RegretMeter:
    """Compares what each delay shows with the best views in hindsight, in constant time per GOP."""

    def __init__(self, fps: float, gop: int) -> None:
        self._fps = fps
        self._scores: dict[DelayMode, deque[_GopScore]] = {
            mode: deque(maxlen=max(1, round(_WINDOW_S * fps / gop))) for mode in DelayMode
        }
        self._work = _Work()
        self._hindsight: dict[int, _Hindsight] = {}
        self._decisions: dict[tuple[DelayMode, int], ModeDecision] = {}

    def add_costs(self, final: FinalCosts, switch_cost: float) -> None:
        """Add the final costs of the next GOP."""
        self._hindsight[final.first] = _Hindsight(final, self._advance(final, switch_cost))
        for mode in DelayMode:
            self._score(mode, final.first, switch_cost)
        self._forget()

    def add_decision(self, decision: ModeDecision, switch_cost: float) -> None:
        """Add the views that one delay shows in a GOP, before or after its costs."""
        self._decisions[decision.mode, decision.first] = decision
        self._score(decision.mode, decision.first, switch_cost)
        self._forget()

    def score(self, mode: DelayMode) -> ModeScore | None:
        """Return the score of a delay; None: nothing is known yet."""
        scores = self._scores[mode]
        frames = sum(score.person_frames for score in scores)
        if not frames:
            return None
        excess = sum(score.excess for score in scores)
        cuts = sum(score.cuts for score in scores)
        return ModeScore(max(_MINUTE_S * excess / frames, 0.0), _MINUTE_S * self._fps * cuts / frames)

    def _advance(self, final: FinalCosts, switch_cost: float) -> Floats:
        """Return by how much the GOP raises the cost of each person's best views."""
        cameras, people = final.cost.shape
        work = np.zeros((cameras, people))
        _, old, new = np.intersect1d(
            self._work.numbers, final.numbers, assume_unique=True, return_indices=True
        )
        if old.size:
            work[:, new] = self._work.cost[:, old]
        least = work.min(axis=0, initial=np.inf)
        possible = np.isfinite(final.cost).any(axis=0)
        gap = NO_VIEW_COST * final.frames
        moved = np.minimum(work, least + switch_cost) + np.where(possible, final.cost, gap)
        raised = moved.min(axis=0, initial=np.inf)
        # A camera that cannot be shown can be returned to at the cost of a cut.
        moved = np.minimum(moved, raised + switch_cost)
        self._work = _Work(final.numbers, moved - raised)
        return np.asarray(raised - least)

    def _score(self, mode: DelayMode, first: int, switch_cost: float) -> None:
        hindsight, decision = self._hindsight.get(first), self._decisions.get((mode, first))
        if hindsight is None or decision is None:
            return
        del self._decisions[mode, first]
        final = hindsight.final
        _, costs, shown = np.intersect1d(
            final.numbers, decision.numbers, assume_unique=True, return_indices=True
        )
        is_seen = (final.cost[:, costs] < NO_VIEW_COST * final.frames).any(axis=0)
        costs, shown = costs[is_seen], shown[is_seen]
        views, before = decision.views[shown], decision.before[shown]
        cost = final.cost[views, costs]
        cost = np.where((views == NO_CAMERA) | np.isinf(cost), NO_VIEW_COST * final.frames, cost)
        cuts = int(np.count_nonzero((before != NO_CAMERA) & (views != NO_CAMERA) & (views != before)))
        excess = float(cost.sum() - hindsight.optimum[costs].sum()) + switch_cost * cuts
        self._scores[mode].append(_GopScore(excess, cuts, final.frames * len(shown)))

    def _forget(self) -> None:
        while len(self._hindsight) > _PENDING_GOPS:
            del self._hindsight[next(iter(self._hindsight))]
        while len(self._decisions) > _PENDING_GOPS:
            del self._decisions[next(iter(self._decisions))]
