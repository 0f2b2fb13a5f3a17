"""Solver protocol, solutions with their proof, and the registry of solvers by name."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import ClassVar, Literal, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from tracking.model.network import Network
from tracking.solvers.budget import BudgetMeter, Limit, SolverBudget
from tracking.solvers.warm_start import ConflictPrice, WarmStart

OCCLUDED = -1
"""The state of an object that has no observation in a frame."""

# Imported on demand: a tracker with a dynamic program does not load the LP solver.
_SOLVERS = {
    "arcs": ("tracking.solvers.arc_program", "ArcProgramSolver"),
    "columns": ("tracking.solvers.column_generation", "ColumnGenerationSolver"),
    "exact": ("tracking.solvers.exact", "ExactSolver"),
    "extended-dp": ("tracking.solvers.joint_dp", "JointDpSolver"),
    "greedy-dp": ("tracking.solvers.dynamic_programming", "GreedyDpSolver"),
    "l2": ("tracking.solvers.column_generation", "SquaredLayoutSolver"),
    "separate-dp": ("tracking.solvers.dynamic_programming", "SeparateDpSolver"),
}

DEFAULT_SOLVER = "columns"

Status = Literal["optimal", "gap", "limit"]

_OPTIMALITY_GAP = 1e-9
"""The largest gap that counts as none."""


@dataclass(frozen=True, slots=True)
class SolveReport:
    """What is proven about a solution.

    Attributes:
        solver: the name of the solver.
        objective: cost of the integer states returned (II.C).
        bound: proven lower bound of the cost of any states without conflicts.
        integral: whether the relaxation was integral, so that nothing was rounded. `exact` may find the
            optimum where it was not; `extended-dp` and the baselines solve none. See `status`.
        conflicts: number of conflicting pairs of objects over all frames; only `separate-dp`, which ignores
            conflicts, leaves any.
        rounds: how often the linear program (or a dynamic program over all objects) was solved; 0 if the
            solution was proven without.
        limit: the limit of the budget that was reached; None: the solver has ended by itself.
        skipped: the steps that the budget has cut short.
        seconds: elapsed time; not part of comparisons.
    """

    solver: str
    objective: float
    bound: float
    integral: bool
    conflicts: int
    rounds: int
    limit: Limit | None = None
    skipped: tuple[str, ...] = ()
    seconds: float = field(default=0.0, compare=False)

    @property
    def status(self) -> Status:
        """`optimal`: proven, up to rounding errors; `limit`: the budget was spent before; `gap`: the rest."""
        if not self.conflicts and self.gap <= _OPTIMALITY_GAP:
            return "optimal"
        return "limit" if self.limit else "gap"

    @property
    def gap(self) -> float:
        """Largest distance from the optimum, relative to max(1, |objective|); never negative."""
        if not math.isfinite(self.objective):
            return math.inf
        return max(0.0, self.objective - self.bound) / max(1.0, abs(self.objective))


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """The observation of each object in each frame of a window.

    Attributes:
        states: (n, M) int64, the index of the observation in its frame, or -1: occluded.
        report: what is proven about it.
        prices: the binding conflict rows, if the solver knows them.
    """

    states: NDArray[np.int64]
    report: SolveReport
    prices: tuple[ConflictPrice, ...] = ()

    @property
    def warm_start(self) -> WarmStart:
        """This solution as a warm start for a window that shares frames; see `WarmStart.shift`."""
        return WarmStart(self.prices, self.states)


class Solver(Protocol):
    """Finds the paths of all objects of a window; stateless, so that one serves many trackers."""

    @property
    def name(self) -> str:
        """The name in the registry."""

    def solve(self, network: Network, warm_start: WarmStart | None = None) -> Solution:
        """Return the states of all objects in all frames; the same input gives the same result.

        A warm start (`Solution.warm_start.shift(...)` of the previous window) only makes it faster.
        """


class PartsSolver(Solver, Protocol):
    """Also solves parts that have nothing in common."""

    def start(self) -> BudgetMeter:
        """Return a meter of the budget of one solve."""

    def solve_parts(self, networks: Sequence[Network], meter: BudgetMeter | None = None) -> list[Solution]:
        """Return the solutions of networks that are parts of one, and share the budget of one.

        `meter`: of that budget, of which some may be spent; None: nothing is.
        """


def add_reports(solver: str, reports: Sequence[SolveReport], rest: float = 0.0) -> SolveReport:
    """Return what is proven about parts that share nothing together; `rest`: the cost of what needed none."""
    return SolveReport(
        solver=solver,
        objective=rest + math.fsum(report.objective for report in reports),
        bound=rest + math.fsum(report.bound for report in reports),
        integral=all(report.integral for report in reports),
        conflicts=sum(report.conflicts for report in reports),
        rounds=sum(report.rounds for report in reports),
        limit=next((report.limit for report in reports if report.limit), None),
        skipped=tuple(dict.fromkeys(step for report in reports for step in report.skipped)),
        seconds=math.fsum(report.seconds for report in reports),
    )


def solver_names() -> tuple[str, ...]:
    """Return the names of all solvers, sorted."""
    return tuple(sorted(_SOLVERS))


def create_solver(name: str, budget: SolverBudget | None = None) -> PartsSolver:
    """Return the solver of that name; `budget` limits each of its solves.

    When a limit is reached, the solver rounds what it has and returns the cheapest answer and the best bound
    that it knows. What remains to be done takes little: greedy paths, and the costs of some candidates.

    Raises:
        ValueError: no solver has that name; the message lists the names.
    """
    if name not in _SOLVERS:
        raise ValueError(f"no solver is called {name!r}; there are {', '.join(solver_names())}")
    module, factory = _SOLVERS[name]
    return cast("PartsSolver", getattr(import_module(module), factory)(budget))


class TimedSolver(ABC):
    """Base class that reports the elapsed time of each solve."""

    name: ClassVar[str]

    def __init__(self, budget: SolverBudget | None = None) -> None:
        self._budget = budget

    def solve(self, network: Network, warm_start: WarmStart | None = None) -> Solution:
        """Return the states of all objects in all frames; a warm start only makes it faster."""
        return self._timed(network, warm_start, self.start())

    def start(self) -> BudgetMeter:
        """Return a meter of the budget of one solve."""
        return BudgetMeter(self._budget)

    def solve_parts(self, networks: Sequence[Network], meter: BudgetMeter | None = None) -> list[Solution]:
        """Return the solutions of networks that share the budget, the smallest first.

        The hardest parts get what is left, so that they keep no other from being solved.
        """
        meter = meter or self.start()
        solutions: dict[int, Solution] = {}
        for k in sorted(range(len(networks)), key=lambda k: networks[k].node.size):
            part = meter.rest()
            solutions[k] = self._timed(networks[k], None, part)
            meter.work_s += part.work_s
        return [solutions[k] for k in range(len(networks))]

    def _timed(self, network: Network, warm_start: WarmStart | None, meter: BudgetMeter) -> Solution:
        start = time.perf_counter()
        solution = self._solve(network, warm_start, meter)
        seconds = time.perf_counter() - start
        return replace(solution, report=replace(solution.report, seconds=seconds))

    @abstractmethod
    def _solve(self, network: Network, warm_start: WarmStart | None, meter: BudgetMeter) -> Solution:
        """Solve the network, which may have no objects, within the meter's budget."""
