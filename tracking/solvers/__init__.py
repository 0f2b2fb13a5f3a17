"""Solvers of the network: pick one by name with `solver_named`."""

from __future__ import annotations

from tracking.solvers.base import (
    DEFAULT_SOLVER,
    OCCLUDED,
    Solution,
    Solver,
    SolveReport,
    solver_named,
    solver_names,
)
from tracking.solvers.warm_start import UNKNOWN, Hint, PricedRow

__all__ = [
    "DEFAULT_SOLVER",
    "OCCLUDED",
    "UNKNOWN",
    "Hint",
    "PricedRow",
    "Solution",
    "SolveReport",
    "Solver",
    "solver_named",
    "solver_names",
]
