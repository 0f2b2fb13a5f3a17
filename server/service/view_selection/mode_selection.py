"""The views of all delays, selected beside the balanced ones, and how good each delay's are."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bestview import GopCosts
from server.config.sections import ViewSettings
from server.config.site_config import Config
from server.service.view_selection.delay_modes import (
    DelayMode,
    FinalCosts,
    LiveSelector,
    ModeDecision,
    SmoothSelector,
)
from server.service.view_selection.lookahead_window import LookaheadPart, LookaheadWindow
from server.service.view_selection.regret import ModeScore, RegretMeter

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class ModeSelection:
    """Selects the views of the delays live and smooth, and measures the regret of all."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._live, self._smooth = LiveSelector(config), SmoothSelector(config)
        self._regret = RegretMeter(config.site.fps, config.gop)
        self._decided: list[ModeDecision] = []
        self.change(config.view)

    def change(self, view: ViewSettings) -> None:
        """Apply other settings that can change while the service runs."""
        fps, gop = self._config.site.fps, self._config.gop
        longer = round(view.smooth_lookahead_s * fps) - self._config.lookahead_of(view)
        self._behind = max(0, -(-longer // gop))
        self._switch_cost = view.switch_cost_s * fps
        self._min_shot_gops = -(-round(view.min_shot_s * fps) // gop)

    @property
    def smooth_lookahead(self) -> int:
        """GOPs that the delay smooth looks ahead further than balanced."""
        return self._behind

    def step(self, last: int, window: Callable[[], LookaheadWindow], *, skipped: bool) -> None:
        """Select the live views that are due when frames up to `last` are known; `window` returns them."""
        if skipped:
            self._live.restart()
        if self._live.is_due(last):
            self._put(self._live.decide(window(), last, self._switch_cost, self._min_shot_gops))

    def add(
        self, part: LookaheadPart, frames: int, gops: GopCosts, weight: Floats, views: Ints, before: Ints
    ) -> None:
        """Add a decision of the delay balanced.

        Args:
            part: its look-ahead, whose first GOP is final.
            frames: the length of that GOP.
            gops: the costs of the look-ahead.
            weight: (N,) of each of its frames.
            views: (K,) the selected cameras.
            before: (K,) those of the GOP before.
        """
        first, hidden = part.window.first + part.first, gops.hidden[0]
        cost = gops.cost[0]
        if (weight[:frames] != 1.0).any():  # the end of a short look-ahead stands for what follows
            ones = np.ones(frames)
            cost = part.gops(np.arange(frames) == 0, ones, mark_hidden=False).cost[0]
        final = FinalCosts(first, frames, part.numbers, cost, hidden)
        self._regret.add_costs(final, self._switch_cost)
        self._regret.add_decision(
            ModeDecision(DelayMode.BALANCED, first, frames, part.numbers, views, before, part.window.cameras),
            self._switch_cost,
        )
        self._put(self._smooth.decide(final, gops, self._behind, self._switch_cost, self._min_shot_gops))

    def finish(self) -> None:
        """Select the remaining views when all recordings are over."""
        self._put(self._smooth.finish(self._switch_cost, self._min_shot_gops))

    def take(self) -> list[ModeDecision]:
        """Return the decisions since the last call, in order."""
        decided, self._decided = self._decided, []
        return decided

    def score(self, mode: DelayMode) -> ModeScore | None:
        """Return how good a delay's views were in the last minutes; None: nothing is known yet."""
        return self._regret.score(mode)

    def _put(self, decided: list[ModeDecision]) -> None:
        for decision in decided:
            self._regret.add_decision(decision, self._switch_cost)
        self._decided += decided
