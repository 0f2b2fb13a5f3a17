"""Windows as the live tracker solves them: everybody of a moving crowd, warm-started, within the budget."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from benchmarks.solvers.random_windows import HD, Walkers, WindowSize
from server.config.sections import TrackSettings
from tracking import OnlineTracker
from tracking.boxes import Floats
from tracking.frame_rate import DEFAULT_FPS
from tracking.model.network import Network
from tracking.solvers import Solution, Solver
from tracking.solvers.warm_start import WarmStart
from tracking.types import Detections

_SCORE = 0.9
_SETTLING_S = 4.0
"""Seconds until everybody has a track."""


@dataclass(frozen=True, slots=True, eq=False)
class CrowdTimes:
    """Times of the windows of a crowd.

    Attributes:
        windows: (W,) processor seconds of each, with gates, network, new people and all that is done in it.
        solves: (S,) of these, of each solve.
        gaps: (S,) of each solve.
        stopped: (S,) whether the budget ended it.
        objects: (S,) how many objects it was for.
    """

    windows: Floats
    solves: Floats
    gaps: Floats
    stopped: Floats
    objects: Floats


class _TimedSolver:
    """A solver that notes its times and reports."""

    def __init__(self, solver: Solver) -> None:
        self._solver, self.name = solver, solver.name
        self.solved: list[tuple[float, int, Solution]] = []

    def solve(self, network: Network, warm_start: WarmStart | None = None) -> Solution:
        start = time.process_time()
        solution = self._solver.solve(network, warm_start)
        self.solved.append((time.process_time() - start, network.objects, solution))
        return solution


def track_crowd(size: WindowSize, seconds: float, seed: int) -> CrowdTimes:
    """Track people who walk over a square, at 25 frames a second in HD, with the default settings."""
    settings = TrackSettings()
    solver = _TimedSolver(settings.create_solver(DEFAULT_FPS))
    tracker = OnlineTracker(settings.window, settings.costs, solver, DEFAULT_FPS)
    people = Walkers(size, seed, HD)
    windows: list[float] = []
    for frame in range(round((_SETTLING_S + seconds) * DEFAULT_FPS)):
        seen = people.step()
        seen = Detections(seen.boxes, np.full(len(seen), _SCORE), seen.histograms)
        if frame == round(_SETTLING_S * DEFAULT_FPS):
            windows.clear()
            solver.solved.clear()
        start = time.process_time()
        if tracker.push(frame, seen) is not None:
            windows.append(time.process_time() - start)
    times, objects, solutions = zip(*solver.solved, strict=True)
    return CrowdTimes(
        np.array(windows),
        np.array(times),
        np.array([solution.report.gap for solution in solutions]),
        np.array([float(solution.report.limit is not None) for solution in solutions]),
        np.array(objects, dtype=np.float64),
    )
