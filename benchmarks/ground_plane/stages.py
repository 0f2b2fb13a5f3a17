"""Processor time of joint tracking by stage."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import ParamSpec, TypeVar
from unittest.mock import patch

from tracking.ground_plane import keyframe_tracker

P = ParamSpec("P")
R = TypeVar("R")

PLACES, NETWORK, SOLVING, FINISHING, OTHER = "places", "network", "solving", "finishing", "other"
STAGES = (PLACES, NETWORK, SOLVING, FINISHING, OTHER)
"""Hypotheses of places; the costs of the program; its solution; people who move, arrive and leave; the
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


@contextmanager
def timed_stages() -> Iterator[StageClock]:
    """Time the stages of all joint trackers within the context."""
    clock = StageClock()
    tracker = keyframe_tracker.KeyframeTracker
    functions = [
        (keyframe_tracker, "measure", PLACES),
        (keyframe_tracker, "predict_places", PLACES),
        (keyframe_tracker, "find_places", PLACES),
        (tracker, "_solve", NETWORK),
        (keyframe_tracker, "solve_program", SOLVING),
        (tracker, "_finish_oldest", FINISHING),
    ]
    with ExitStack() as stack:
        for owner, name, stage in functions:
            stack.enter_context(patch.object(owner, name, clock.timed(stage, getattr(owner, name))))
        yield clock
        clock.stop()
