"""Views for viewers who choose another delay: live without look-ahead, or smooth with a longer one.

Both share the windows and costs of the balanced decision, and select for all people at once, whether anybody
watches or not: what a viewer is shown depends on the cameras' messages alone, live as offline.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from bestview import NO_CAMERA, NO_VIEW_COST, GopCosts, select_views_by_gop
from server.config.site_config import Config
from server.service.view_selection.current_shots import CurrentShots
from server.service.view_selection.lookahead_window import LookaheadWindow
from tracking.frame_rate import frames_in

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_NEWEST_S = 0.2
"""Seconds of the newest frames whose mean represents the present: a single frame would be too uncertain."""


class DelayMode(StrEnum):
    """What a viewer may choose: how much is known of what follows when a view is selected."""

    LIVE = "live"
    BALANCED = "balanced"
    SMOOTH = "smooth"


@dataclass(frozen=True, slots=True, eq=False)
class FinalCosts:
    """The costs of one GOP whose tracks are final.

    Attributes:
        first: its first pulse.
        frames: its length.
        numbers: (K,) the people's numbers, rising.
        cost: (C, K) the sum over its frames; infinite: the camera cannot be shown.
        hidden: (C, K) where a camera does not show the person; None: not needed.
    """

    first: int
    frames: int
    numbers: Ints
    cost: Floats
    hidden: Mask | None

    def of(self, numbers: Ints) -> tuple[Floats, Mask | None]:
        """Return costs and hiddenness for other people, (C, K') rising; nobody sees those who are new."""
        unavailable = np.asarray(np.isinf(self.cost).all(axis=1) & (len(self.numbers) > 0))
        shape = (len(self.cost), len(numbers))
        cost = np.where(unavailable[:, None], np.inf, np.full(shape, NO_VIEW_COST * self.frames))
        hidden = None if self.hidden is None else np.ones(shape, dtype=np.bool_)
        _, old, new = np.intersect1d(self.numbers, numbers, assume_unique=True, return_indices=True)
        cost[:, new] = self.cost[:, old]
        if hidden is not None and self.hidden is not None:
            hidden[:, new] = self.hidden[:, old]
        return cost, hidden


@dataclass(frozen=True, slots=True, eq=False)
class ModeDecision:
    """All people's views in the frames ``first … first + frames - 1``, for the viewers of one delay.

    Attributes:
        numbers: (K,) the people's numbers, rising.
        views: (K,) the camera of each, by index; -1: none can be shown.
        before: (K,) that of the GOP before.
        names: the cameras.
    """

    mode: DelayMode
    first: int
    frames: int
    numbers: Ints
    views: Ints
    before: Ints
    names: Sequence[str]

    @property
    def cameras(self) -> dict[int, str | None]:
        """The camera of each person; None: none can be shown."""
        return dict(self._named(self.views))

    @property
    def cuts(self) -> Iterator[tuple[int, str, str]]:
        """The people whose camera changes, with the cameras before and after."""
        before = dict(self._named(self.before))
        for number, camera in self._named(self.views):
            previous = before[number]
            if previous is not None and camera is not None and previous != camera:
                yield number, previous, camera

    def _named(self, views: Ints) -> Iterator[tuple[int, str | None]]:
        for number, view in zip(self.numbers.tolist(), views.tolist(), strict=True):
            yield number, None if view == NO_CAMERA else self.names[view]


class LiveSelector:
    """Selects causally: by the newest frames that are known a moment before a GOP begins.

    They are assumed to stay for `view.live_horizon_s`, so a cut must gain its cost within it: hysteresis.
    """

    def __init__(self, config: Config) -> None:
        fps = config.site.fps
        self._names, self._gop = config.camera_ids, config.gop
        self._lag, self._newest = frames_in(config.view.live_lag_s, fps, 0), frames_in(_NEWEST_S, fps)
        self._weight: Floats = np.full(self._newest, config.view.live_horizon_s * fps / self._newest)
        self._shots = CurrentShots()
        self._next: int | None = None

    def is_due(self, last: int) -> bool:
        """Return whether a GOP must be decided when frames up to `last` are known."""
        return self._next is None or self._next - 1 - self._lag <= last

    def restart(self) -> None:
        """Continue with the next GOP after skipped frames."""
        self._next = None

    def decide(
        self, window: LookaheadWindow, last: int, switch_cost: float, min_shot_gops: int
    ) -> list[ModeDecision]:
        """Decide the GOPs that are due, by a window whose last frame is `last`."""
        if self._next is None:
            self._next = (last // self._gop + 1) * self._gop
        frames = min(self._newest, last + 1 - window.first)
        decided: list[ModeDecision] = []
        while self.is_due(last):
            part = window.part(last + 1 - frames, frames, window.seen_since(last))
            starts = np.arange(frames) == 0
            costs = part.gops(starts, self._weight[:frames], mark_hidden=min_shot_gops > 1)
            before = self._shots.of(part.numbers)
            views = _select(costs, before, switch_cost, min_shot_gops)
            decided.append(
                ModeDecision(
                    DelayMode.LIVE, self._next, self._gop, part.numbers, views, before.cameras, self._names
                )
            )
            self._shots = before.then(views)
            self._next += self._gop
        return decided


class SmoothSelector:
    """Selects with a longer look-ahead: its first GOPs are final, and their costs are known already."""

    def __init__(self, config: Config) -> None:
        self._names = config.camera_ids
        self._shots = CurrentShots()
        self._final: deque[FinalCosts] = deque()
        """Of GOPs that are not decided yet, in order."""

    def decide(
        self, final: FinalCosts, ahead: GopCosts, behind: int, switch_cost: float, min_shot_gops: int
    ) -> list[ModeDecision]:
        """Add a GOP, and decide those that are more than `behind` GOPs before it.

        Args:
            final: its costs.
            ahead: the costs of it and of the GOPs of the look-ahead after it, for the same people.
            behind: how many GOPs the longer look-ahead is longer.
            switch_cost: of one cut.
            min_shot_gops: the shortest shot.
        """
        decided = []
        if self._final and self._final[-1].first + self._final[-1].frames != final.first:
            decided = self.finish(switch_cost, min_shot_gops)
        self._final.append(final)
        while len(self._final) > behind:
            decided.append(self._decide(final.numbers, ahead, switch_cost, min_shot_gops))
        return decided

    def finish(self, switch_cost: float, min_shot_gops: int) -> list[ModeDecision]:
        """Decide the remaining GOPs when nothing follows them."""
        decided = []
        while self._final:
            last = self._final[-1]
            nothing = GopCosts([last.cost], np.array([float(last.frames)]), [last.hidden])
            decided.append(self._decide(last.numbers, nothing, switch_cost, min_shot_gops))
        return decided

    def _decide(self, numbers: Ints, ahead: GopCosts, switch_cost: float, min_shot_gops: int) -> ModeDecision:
        """Decide the first GOP of all; `ahead` begins with the last of them."""
        first, between = self._final.popleft(), list(self._final)[:-1]
        known = [first, *between] if self._final else []  # otherwise the first is also the last
        there = np.flatnonzero(np.isin(numbers, first.numbers))
        numbers, ahead = numbers[there], ahead.for_people(there)  # others have not been seen yet
        costs = [final.of(numbers) for final in known]
        gops = GopCosts(
            [*(cost for cost, _ in costs), *ahead.cost],
            np.concatenate([[float(final.frames) for final in known], ahead.frames]),
            [*(hidden for _, hidden in costs), *ahead.hidden],
        )
        before = self._shots.of(numbers)
        views = _select(gops, before, switch_cost, min_shot_gops)
        self._shots = before.then(views)
        return ModeDecision(
            DelayMode.SMOOTH, first.first, first.frames, numbers, views, before.cameras, self._names
        )


def _select(gops: GopCosts, before: CurrentShots, switch_cost: float, min_shot_gops: int) -> Ints:
    (views,), _ = select_views_by_gop(
        gops, before.cameras, switch_cost, min_shot_gops, before.gops, decided_gops=1
    )
    return np.asarray(views)
