"""The interior-point solver Clarabel for programs with squared columns, one thread and no time limit.

HiGHS' active-set method for quadratic programs cycles without end on tied windows. An interior point has no
vertices to cycle between; its duals are exact to about 1e-9, and any duals prove a bound (`ArcGeneration`).
"""

from __future__ import annotations

import clarabel
import highspy
import numpy as np
from scipy import sparse

from tracking.solvers.budget import RELAXATION_SHARE, BudgetMeter
from tracking.solvers.objective import Ints
from tracking.solvers.programs.linear_program import LinearSolution, WorkLimitError

_ACCURACY = 1e-9
"""Relative and absolute accuracy of constraints, duals and gap."""

_USUAL_ITERATIONS, _MAX_ITERATIONS = 20, 100


def solve_quadratic_program(
    model: highspy.HighsLp, squared: Ints, weight: float, meter: BudgetMeter
) -> LinearSolution:
    """Minimize the model's costs plus `weight` times the squares of the columns `squared`.

    The columns are not negative, free or fixed at 0; the rows are equations or have an upper side only.

    Raises:
        WorkLimitError: the meter's budget does not allow the usual number of iterations.
        RuntimeError: the solver finds no point at all; every network has one.
    """
    matrix = _matrix_of(model)
    expected = BudgetMeter()
    expected.add_interior_iterations(_USUAL_ITERATIONS, matrix.nnz)
    if expected.work_s > meter.left(RELAXATION_SHARE):
        raise WorkLimitError
    columns = len(model.col_cost_)
    lower, upper = np.asarray(model.col_lower_), np.asarray(model.col_upper_)
    row_lower, row_upper = np.asarray(model.row_lower_), np.asarray(model.row_upper_)
    used = np.flatnonzero(lower < upper)
    place = np.full(columns, -1)
    place[used] = np.arange(len(used))
    equal = np.isfinite(row_lower)
    bounded = np.flatnonzero(np.isfinite(lower[used]))
    signs = sparse.csc_array(
        (np.full(len(bounded), -1.0), (np.arange(len(bounded)), bounded)), shape=(len(bounded), len(used))
    )
    stacked = sparse.vstack([matrix[equal][:, used], matrix[~equal][:, used], signs], format="csc")
    squares = np.zeros(len(used))
    squares[place[squared]] = 2.0 * weight
    found = clarabel.DefaultSolver(
        sparse.csc_matrix(sparse.diags_array(squares)),
        np.asarray(model.col_cost_)[used],
        sparse.csc_matrix(stacked),
        np.concatenate([row_upper[equal], row_upper[~equal], np.zeros(len(bounded))]),
        [
            clarabel.ZeroConeT(int(equal.sum())),
            clarabel.NonnegativeConeT(int((~equal).sum()) + len(bounded)),
        ],
        _settings(),
    ).solve()
    meter.add_step()
    meter.add_interior_iterations(int(found.iterations), matrix.nnz)
    point, multipliers = np.asarray(found.x), np.asarray(found.z)
    if not np.isfinite(point).all() or not np.isfinite(multipliers).all():
        raise RuntimeError(f"the solver of the quadratic program ended with {found.status}")
    values, duals = np.zeros(columns), np.empty(len(row_lower))
    values[used] = point
    duals[equal] = -multipliers[: int(equal.sum())]
    duals[~equal] = -multipliers[int(equal.sum()) : len(row_lower)]
    return LinearSolution(values, duals, float(found.obj_val), int(found.iterations))


def _matrix_of(model: highspy.HighsLp) -> sparse.csr_array:
    """Return the model's matrix, which HiGHS keeps by columns or by rows."""
    shape = (model.num_row_, model.num_col_)
    parts = (np.asarray(model.a_matrix_.value_), model.a_matrix_.index_, model.a_matrix_.start_)
    if model.a_matrix_.format_ == highspy.MatrixFormat.kColwise:
        return sparse.csr_array(sparse.csc_array(parts, shape=shape))
    return sparse.csr_array(parts, shape=shape)


def _settings() -> clarabel.DefaultSettings:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.direct_solve_method = "qdldl"
    settings.max_iter = _MAX_ITERATIONS
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _ACCURACY
    return settings
