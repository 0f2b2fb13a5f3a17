"""How long a solver may take: a deterministic amount of work, or time by the clock.

Work is counted in what solvers do (arcs of Viterbi passes, simplex iterations), weighed by what each took
on an ordinary machine, one thread at about 2.5 GHz. So a limit in seconds of work stops every machine at the
same point, and the same input gives the same answer. A limit by the clock depends on the machine, and on what
else it does.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Literal

Limit = Literal["work", "time"]

RELAXATION_SHARE = 0.6
"""Share of the budget for the relaxation; the rest is for rounding and local search."""

_PASS_ARC = 3e-9
"""Seconds for an arc of a Viterbi pass."""
_LIST_ARC = 1.5e-7
"""Seconds for an arc of a list in a Viterbi pass, with the layout term."""
_MOVEMENT_STEP, _MOVEMENT_ARC, _MOVEMENT_CELL = 2.2e-5, 3e-8, 1e-9
"""Seconds for a step with prices of movements, and more for each arc, and each cell and other object."""
_ITERATION, _ITERATION_ENTRY = 1e-5, 5e-9
"""Seconds for a simplex iteration, and more for each entry of the matrix."""
_INTERIOR_ENTRY = 3e-7
"""Seconds for an entry of the matrix in an iteration of the interior-point method."""
_HARDLY_ANY = 1e-9
_STEP = 5e-4
"""Seconds for whatever else a step of a search does."""


@dataclass(frozen=True, slots=True)
class SolverBudget:
    """Limits of one solve.

    Attributes:
        work_s: seconds of work on an ordinary machine; None: no limit.
        time_s: seconds by the clock, after which answers differ from run to run; None: no limit.

    Raises:
        ValueError: a limit is not positive.
    """

    work_s: float | None = None
    time_s: float | None = None

    def __post_init__(self) -> None:
        if any(limit is not None and not limit > 0.0 for limit in (self.work_s, self.time_s)):
            raise ValueError(f"limits of a solver are above 0 seconds, not {self.work_s} and {self.time_s}")


class BudgetMeter:
    """Adds up the work of one solve. Solvers ask it between steps whether they may go on."""

    def __init__(self, budget: SolverBudget | None = None) -> None:
        self._budget = budget or SolverBudget()
        self._start = time.perf_counter() if self._budget.time_s else 0.0
        self.work_s = 0.0
        """Seconds of work so far."""

    def reached(self, share: float = 1.0) -> Limit | None:
        """Return the limit of which this share is spent; None: neither."""
        work, clock = self._budget.work_s, self._budget.time_s
        if work is not None and self.work_s >= share * work:
            return "work"
        if clock is not None and time.perf_counter() - self._start >= share * clock:
            return "time"
        return None

    def left(self, share: float = 1.0) -> float:
        """Return the seconds left until this share is spent; infinite without a limit."""
        work, clock = self._budget.work_s, self._budget.time_s
        left = float("inf") if work is None else share * work - self.work_s
        if clock is not None:
            left = min(left, share * clock - (time.perf_counter() - self._start))
        return max(left, 0.0)

    def rest(self) -> BudgetMeter:
        """Return a meter of what is left; nothing left is hardly anything."""
        work, clock = self._budget.work_s, self._budget.time_s
        left = None if work is None else max(work - self.work_s, _HARDLY_ANY)
        if clock is not None:
            clock = max(clock - (time.perf_counter() - self._start), _HARDLY_ANY)
        return BudgetMeter(SolverBudget(left, clock))

    def add_step(self) -> None:
        """Add a step of a search."""
        self.work_s += _STEP

    def add_passes(self, objects: int, frames: int, states: int) -> None:
        """Add a Viterbi pass of each object."""
        self.work_s += _PASS_ARC * objects * frames * states**2

    def add_arcs(self, objects: int, arcs: int) -> None:
        """Add a pass over the arcs of each object one by one, as they are in a sparse trellis."""
        self.work_s += _LIST_ARC * objects * arcs

    def add_movement_prices(self, objects: int, steps: int, cells: int, arcs: int) -> None:
        """Add a step of the prices of movements: all arcs, and all pairs of objects in all cells."""
        self.work_s += steps * _MOVEMENT_STEP
        self.work_s += objects * (_MOVEMENT_ARC * arcs + _MOVEMENT_CELL * steps * objects * cells)

    def add_iterations(self, iterations: int, entries: int) -> None:
        """Add simplex iterations on a matrix of so many entries."""
        self.work_s += iterations * (_ITERATION + _ITERATION_ENTRY * entries)

    def iterations_left(self, entries: int, share: float = 1.0) -> int | None:
        """Return how many simplex iterations are left; None: any number."""
        left = self.left(share)
        return None if left == float("inf") else int(left / (_ITERATION + _ITERATION_ENTRY * entries))

    def add_interior_iterations(self, iterations: int, entries: int) -> None:
        """Add iterations of the interior-point method."""
        self.work_s += iterations * _INTERIOR_ENTRY * entries
