"""Solvers of the network: pick one by name with `create_solver`."""

from __future__ import annotations

from tracking.solvers.base import (
    DEFAULT_SOLVER,
    OCCLUDED,
    PartsSolver,
    Solution,
    Solver,
    SolveReport,
    create_solver,
    solver_names,
)
from tracking.solvers.budget import SolverBudget
from tracking.solvers.warm_start import UNKNOWN_STATE, ConflictPrice, WarmStart

__all__ = [
    "DEFAULT_SOLVER",
    "OCCLUDED",
    "UNKNOWN_STATE",
    "ConflictPrice",
    "PartsSolver",
    "Solution",
    "SolveReport",
    "Solver",
    "SolverBudget",
    "WarmStart",
    "create_solver",
    "solver_names",
]
