"""The LP solver HiGHS with fixed options, for deterministic results: one thread, simplex, no time limit."""

from __future__ import annotations

from dataclasses import dataclass

import highspy
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from tracking.boxes import Floats
from tracking.solvers.budget import RELAXATION_SHARE, BudgetMeter


@dataclass(frozen=True, slots=True, eq=False)
class LinearProgram:
    """Minimize `costs x` with `row_lower <= matrix x <= row_upper` and `lower <= x <= upper`."""

    costs: Floats
    lower: Floats
    upper: Floats
    matrix: sparse.csc_array
    row_lower: Floats
    row_upper: Floats


@dataclass(frozen=True, slots=True, eq=False)
class LinearSolution:
    """The optimum: `values` (columns,), `duals` (rows,), the `objective`, and simplex `iterations`."""

    values: Floats
    duals: Floats
    objective: float
    iterations: int


_DEVEX = 1
"""Edge weights without initialization cost: a growing program is solved from many bases."""

_DUAL, _CHOOSE = 1, 0
"""Simplex strategies: dual, best without a basis; or primal after new columns and dual after new rows."""


def create_highs(*, growing: bool = False, presolve: bool = False) -> highspy.Highs:
    """Return a deterministic solver without output; `growing`: columns will be added.

    With `presolve` the program is reduced before the first solve; later solves continue from the last basis.
    """
    solver: highspy.Highs = highspy.Highs()  # type: ignore[no-untyped-call]
    options: dict[str, bool | int | float | str] = {
        "output_flag": False,
        "threads": 1,
        "parallel": "off",
        "solver": "simplex",
        "simplex_strategy": _CHOOSE if growing else _DUAL,
        "presolve": "on" if presolve else "off",
        "random_seed": 0,
        "primal_feasibility_tolerance": 1e-9,
        "dual_feasibility_tolerance": 1e-9,
    }
    if growing:
        options["simplex_dual_edge_weight_strategy"] = _DEVEX
    for name, value in options.items():
        if solver.setOptionValue(name, value) != highspy.HighsStatus.kOk:
            raise RuntimeError(f"the LP solver rejects {name} = {value}")
    return solver


def to_highs_model(program: LinearProgram) -> highspy.HighsLp:
    """Convert a program to a HiGHS model."""
    model = highspy.HighsLp()
    rows, columns = program.matrix.shape
    model.num_col_ = columns
    model.num_row_ = rows
    model.col_cost_ = program.costs
    model.col_lower_ = program.lower
    model.col_upper_ = program.upper
    model.row_lower_ = program.row_lower
    model.row_upper_ = program.row_upper
    model.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    model.a_matrix_.start_ = program.matrix.indptr
    model.a_matrix_.index_ = program.matrix.indices
    model.a_matrix_.value_ = program.matrix.data
    return model


_FALLBACKS: tuple[tuple[str, str], ...] = (("presolve", "off"),)
"""Options of further attempts, without a basis, if no optimum is found: a basis from before columns and rows
were added may be ill-conditioned, and presolve has reported feasible integer programs as infeasible."""


_SOLVED = (highspy.HighsModelStatus.kOptimal, highspy.HighsModelStatus.kModelEmpty)
"""A program without columns and rows has an optimum, too."""


class WorkLimitError(Exception):
    """A program was not solved within the budget."""


_ANY_ITERATIONS = 2**31 - 1


def run_highs(solver: highspy.Highs, meter: BudgetMeter | None = None) -> LinearSolution:
    """Run the solver and return its solution.

    Raises:
        WorkLimitError: the relaxation's share of the meter's budget is spent before.
        RuntimeError: the solver finds no optimum; every network has one.
    """
    meter = meter or BudgetMeter()
    entries = solver.getNumNz()
    left = meter.iterations_left(entries, RELAXATION_SHARE)
    solver.setOptionValue("simplex_iteration_limit", _ANY_ITERATIONS if left is None else left)
    solver.run()
    meter.add_step()
    meter.add_iterations(int(solver.getInfo().simplex_iteration_count), entries)
    status = solver.getModelStatus()
    if status == highspy.HighsModelStatus.kIterationLimit:
        raise WorkLimitError
    for name, value in _FALLBACKS:
        if status in _SOLVED:
            break
        _, usual = solver.getOptionValue(name)
        solver.clearSolver()
        solver.setOptionValue(name, value)
        solver.run()
        status = solver.getModelStatus()
        solver.setOptionValue(name, usual)
    if status not in _SOLVED:
        raise RuntimeError(f"the LP solver ended with {solver.modelStatusToString(status)}")
    found = solver.getSolution()
    info = solver.getInfo()
    return LinearSolution(
        values=np.asarray(found.col_value),
        duals=np.asarray(found.row_dual),
        objective=float(info.objective_function_value),
        iterations=int(info.simplex_iteration_count),
    )


_NODE_ENTRY = 2e-6
"""Seconds of work for an entry of the matrix in a node of branch and bound."""


def solve_program(
    program: LinearProgram, integer: NDArray[np.bool_] | None = None, meter: BudgetMeter | None = None
) -> LinearSolution:
    """Solve one program; columns where `integer` is true take integer values.

    Raises:
        WorkLimitError: the meter's budget is spent before.
    """
    solver = create_highs()
    model = to_highs_model(program)
    if integer is not None:
        kinds = (highspy.HighsVarType.kContinuous, highspy.HighsVarType.kInteger)
        model.integrality_ = [kinds[int(is_integer)] for is_integer in integer]
        for name in ("mip_rel_gap", "mip_abs_gap"):
            solver.setOptionValue(name, 0.0)
        solver.setOptionValue("presolve", "on")
        solver.setOptionValue("solver", "choose")
    solver.passModel(model)
    if integer is None or meter is None or meter.left() == float("inf"):
        return run_highs(solver, meter)
    nodes = int(meter.left() / (_NODE_ENTRY * program.matrix.nnz))
    if not nodes:
        raise WorkLimitError
    solver.setOptionValue("mip_max_nodes", nodes)
    solver.run()
    meter.work_s += _NODE_ENTRY * program.matrix.nnz * int(max(solver.getInfo().mip_node_count, 1))
    if solver.getModelStatus() != highspy.HighsModelStatus.kOptimal:
        raise WorkLimitError
    return run_highs(solver)


class LinearProgramBuilder:
    """Collects the columns and rows of a program; entries at the same position add up."""

    def __init__(self) -> None:
        self._costs: list[Floats] = []
        self._lower: list[Floats] = []
        self._row_lower: list[Floats] = []
        self._row_upper: list[Floats] = []
        self._entries: list[tuple[NDArray[np.int64], NDArray[np.int64], Floats]] = []
        self._columns = 0
        self._rows = 0

    def add_columns(self, costs: Floats, lower: float = 0.0) -> NDArray[np.int64]:
        """Add columns without upper bound; return their indices."""
        first, self._columns = self._columns, self._columns + len(costs)
        self._costs.append(costs)
        self._lower.append(np.full(len(costs), lower))
        return np.arange(first, self._columns)

    def add_rows(self, count: int, lower: float, upper: float) -> NDArray[np.int64]:
        """Add `count` empty rows; return their indices."""
        first, self._rows = self._rows, self._rows + count
        self._row_lower.append(np.full(count, lower))
        self._row_upper.append(np.full(count, upper))
        return np.arange(first, self._rows)

    def add_entries(self, rows: ArrayLike, columns: ArrayLike, values: ArrayLike) -> None:
        """Add values to the matrix; the three arguments broadcast."""
        row, column, value = np.broadcast_arrays(rows, columns, values)
        self._entries.append(
            (
                row.ravel().astype(np.int64),
                column.ravel().astype(np.int64),
                value.ravel().astype(np.float64),
            )
        )

    def program(self) -> LinearProgram:
        """Return the collected program."""
        rows, columns, values = (np.concatenate(part) for part in zip(*self._entries, strict=True))
        matrix = sparse.csc_array(
            sparse.coo_array((values, (rows, columns)), shape=(self._rows, self._columns))
        )
        return LinearProgram(
            costs=np.concatenate(self._costs),
            lower=np.concatenate(self._lower),
            upper=np.full(self._columns, np.inf),
            matrix=matrix,
            row_lower=np.concatenate(self._row_lower),
            row_upper=np.concatenate(self._row_upper),
        )
