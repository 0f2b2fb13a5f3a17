"""The trackers by name: the network program, and what it is measured beside."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Protocol

from tracking.costs import CostSettings
from tracking.detections import Detections
from tracking.detectors.base import Image
from tracking.solvers.base import Solver
from tracking.tracker import OnlineTracker
from tracking.window import WindowResult, WindowSettings
from tracking.yardsticks.method import Method
from tracking.yardsticks.stepwise import StepwiseTracker

DEFAULT_TRACKER = "lp"
"""Multiple object tracking as one linear program in a moving window: MyView's own."""

# Imported when asked for: a camera with the default tracker loads none of them.
_METHODS = {
    "kalman": ("tracking.yardsticks.kalman", "Kalman"),
    "klt": ("tracking.yardsticks.flow", "OpticalFlow"),
    "mcmc": ("tracking.yardsticks.mcmc", "Mcmc"),
    "mean-shift": ("tracking.yardsticks.mean_shift", "MeanShift"),
    "particle": ("tracking.yardsticks.particles", "ParticleFilters"),
}


class Tracker(Protocol):
    """Follows everybody in one camera's pictures. Deterministic, and bounded in memory."""

    def push(self, frame: int, detections: Detections, image: Image | None = None) -> WindowResult | None:
        """Take a frame: what was found in it, and its picture where there is one; a result where windows end.

        Raises:
            ValueError: the frame number is not larger than the last one.
        """
        ...

    def flush(self) -> WindowResult | None:
        """End the recording: all frames become final. `None` where they were already."""
        ...


def tracker_names() -> tuple[str, ...]:
    """Give the names of all trackers."""
    return (DEFAULT_TRACKER, *sorted(_METHODS))


def needs_pictures(name: str) -> bool:
    """Say whether a tracker looks at the pictures itself.

    Raises:
        ValueError: no tracker has that name.
    """
    return name != DEFAULT_TRACKER and bool(_method_of(name).sees)


def tracker_named(
    name: str, window: WindowSettings, costs: CostSettings, solver: Callable[[], Solver]
) -> Tracker:
    """Give a new tracker; only the network program has costs and a solver.

    Raises:
        ValueError: no tracker has that name.
    """
    if name == DEFAULT_TRACKER:
        return OnlineTracker(window, costs, solver())
    return StepwiseTracker(_method_of(name)(), window)


def _method_of(name: str) -> type[Method[Any]]:
    if name not in _METHODS:
        raise ValueError(f"no tracker is called {name!r}; there are {', '.join(tracker_names())}")
    module, method = _METHODS[name]
    found: type[Method[Any]] = getattr(import_module(module), method)
    return found
