"""Processor time of joint tracking by stage."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import ParamSpec, TypeVar
from unittest.mock import patch

from tracking.ground_plane import keyframe_tracker
from tracking.model.network import Network
from tracking.solvers import PartsSolver, Solution, WarmStart
from tracking.solvers.budget import BudgetMeter

P = ParamSpec("P")
R = TypeVar("R")

PLACES, NETWORK, SOLVING, FINISHING, OTHER = "places", "network", "solving", "finishing", "other"
STAGES = (PLACES, NETWORK, SOLVING, FINISHING, OTHER)
"""Hypotheses of places; the program and its parts; their solution; people who move, arrive and leave; the
rest, of which most are boxes between keyframes."""


class StageClock:
    """Adds up the processor time of each stage: a stage within another counts for itself alone."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(STAGES, 0.0)
        self._running = [OTHER]
        self._since = time.process_time()

    def timed(self, stage: str, function: Callable[P, R]) -> Callable[P, R]:
        """Return the function, whose time counts for a stage."""

        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            self._switch()
            self._running.append(stage)
            try:
                return function(*args, **kwargs)
            finally:
                self._switch()
                self._running.pop()

        return call

    def stop(self) -> None:
        """Add the time since the last stage."""
        self._switch()

    def restart(self) -> None:
        """Forget all times."""
        self._switch()
        self.seconds = dict.fromkeys(STAGES, 0.0)

    def _switch(self) -> None:
        now = time.process_time()
        self.seconds[self._running[-1]] += now - self._since
        self._since = now


class ClockedSolver:
    """A solver whose time counts as that of solving."""

    def __init__(self, solver: PartsSolver, clock: StageClock) -> None:
        self._solver = solver
        self._solve = clock.timed(SOLVING, solver.solve)
        self._solve_parts = clock.timed(SOLVING, solver.solve_parts)

    @property
    def name(self) -> str:
        """The name in the registry."""
        return self._solver.name

    def solve(self, network: Network, warm_start: WarmStart | None = None) -> Solution:
        """Solve the network."""
        return self._solve(network, warm_start)

    def start(self) -> BudgetMeter:
        """Return a meter of the budget of one solve."""
        return self._solver.start()

    def solve_parts(self, networks: Sequence[Network], meter: BudgetMeter | None = None) -> list[Solution]:
        """Solve networks that share the budget."""
        return self._solve_parts(networks, meter)


@contextmanager
def timed_stages() -> Iterator[StageClock]:
    """Time the stages of all joint trackers within the context, whose solvers are `ClockedSolver`s."""
    clock = StageClock()
    tracker = keyframe_tracker.KeyframeTracker
    functions = [
        (keyframe_tracker, "measure", PLACES),
        (keyframe_tracker, "predict_places", PLACES),
        (keyframe_tracker, "find_places", PLACES),
        (tracker, "_solve", NETWORK),
        (tracker, "_finish_oldest", FINISHING),
    ]
    with ExitStack() as stack:
        for owner, name, stage in functions:
            stack.enter_context(patch.object(owner, name, clock.timed(stage, getattr(owner, name))))
        yield clock
        clock.stop()
