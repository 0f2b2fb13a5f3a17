"""Processor times of solvers on windows."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.solvers.random_windows import (
    WindowSize,
    meeting_window,
    moving_windows,
    random_window,
    walking_window,
)
from tracking.model.network import CostSettings, Network, build_network
from tracking.model.settings import PAPER_COSTS
from tracking.solvers import Solution, SolverBudget, create_solver

COSTS = replace(PAPER_COSTS, conflict_rows="clique")
"""The paper's costs with the rows of the live tracker."""

GATE = 60.0
"""Pixels per frame: ten times what people move at 25 frames a second and CIF."""

REPEATS = 3
"""Repetitions for the median time of a quick solver."""

Window = Callable[[WindowSize, CostSettings, int], Network]


@dataclass(frozen=True, slots=True)
class WindowCase:
    """A kind of window: its `name`, its generator, and the weight μ of the layout term."""

    name: str
    window: Window
    size: WindowSize
    layout: float = 0.0

    def network(self, seed: int, gate: float | None = None) -> Network:
        """Build the network of a window."""
        return self.window(self.size, replace(COSTS, layout=self.layout, gate=gate), seed)


CASES = (
    WindowCase("random", random_window, WindowSize(3, 50)),
    WindowCase("walking", walking_window, WindowSize(3, 50)),
    WindowCase("meeting", meeting_window, WindowSize(3, 50)),
    WindowCase("random", random_window, WindowSize(10, 40)),
    WindowCase("random", random_window, WindowSize(20, 40, 15)),
    WindowCase("meeting", meeting_window, WindowSize(20, 40, 15)),
    WindowCase("meeting", meeting_window, WindowSize(3, 50), layout=0.001),
    WindowCase("random", random_window, WindowSize(3, 50), layout=0.001),
)

EXACT_CASES = (
    WindowCase("random", random_window, WindowSize(10, 40)),
    WindowCase("walking", walking_window, WindowSize(3, 20), layout=0.0003),
    WindowCase("walking", walking_window, WindowSize(3, 50), layout=0.001),
)


BUDGET_CASES = (
    WindowCase("random", random_window, WindowSize(60, 60, 15)),
    WindowCase("meeting", meeting_window, WindowSize(60, 60, 15)),
    WindowCase("walking", walking_window, WindowSize(8, 20, 15), layout=0.001),
    WindowCase("walking", walking_window, WindowSize(20, 40, 15), layout=0.001),
    WindowCase("meeting", meeting_window, WindowSize(20, 40, 15), layout=0.001),
    WindowCase("random", random_window, WindowSize(20, 40, 15), layout=0.001),
    WindowCase("walking", walking_window, WindowSize(40, 60, 15), layout=0.001),
)
"""Windows that take longer than a stride."""


@dataclass(frozen=True, slots=True, eq=False)
class TimedSolution:
    """A solution with its processor time."""

    seconds: float
    solution: Solution


def timed(solver: str, network: Network, budget: SolverBudget | None = None) -> TimedSolution:
    """Solve a network, and measure the time."""
    found = create_solver(solver, budget)
    start = time.process_time()
    solution = found.solve(network)
    return TimedSolution(time.process_time() - start, solution)


def seconds(solver: str, network: Network, repeats: int = 1) -> float:
    """Return the median time of repeated solves."""
    return float(np.median([timed(solver, network).seconds for _ in range(repeats)]))


def warm_up() -> None:
    """Solve once, so that solvers load their libraries."""
    seconds("columns", random_window(WindowSize(2, 5, 3), COSTS, 0))


@dataclass(frozen=True, slots=True)
class TimeRatio:
    """Median times over windows, seconds, and the median ratio."""

    arcs: float
    columns: float
    ratio: float


def against_arcs(case: WindowCase, seeds: int, gate: float | None) -> TimeRatio:
    """Time the program of all arcs and `columns` on the same windows."""
    networks = [case.network(seed, gate) for seed in range(seeds)]
    arcs = np.array([seconds("arcs", network) for network in networks])
    columns = np.array([seconds("columns", network, REPEATS) for network in networks])
    return TimeRatio(float(np.median(arcs)), float(np.median(columns)), float(np.median(arcs / columns)))


@dataclass(frozen=True, slots=True, eq=False)
class LiveTimes:
    """Times of consecutive windows: `seconds` of each, including building the network, and `rounds`."""

    seconds: np.ndarray
    rounds: np.ndarray


def live(size: WindowSize, steps: int, *, warm: bool) -> LiveTimes:
    """Solve windows at a stride of one frame; `warm`: each with the warm start of the previous one."""
    solver, settings = create_solver("columns"), replace(COSTS, gate=GATE)
    times, rounds = [], []
    hint = None
    for templates, frames in moving_windows(size, steps, seed=0):
        start = time.process_time()
        solution = solver.solve(build_network(templates, frames, settings), hint)
        if warm:
            hint = solution.warm_start.shift(1, range(size.objects))
        times.append(time.process_time() - start)
        rounds.append(solution.report.rounds)
    return LiveTimes(np.array(times), np.array(rounds))
