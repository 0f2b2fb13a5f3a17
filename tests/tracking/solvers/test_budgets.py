"""Budgets: a solver that is stopped has an answer without conflicts and a valid bound, and says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.random_networks import SETTINGS, Case, cases, network_of
from tracking.model.network import Network, Template, build_network
from tracking.model.settings import PAPER_COSTS
from tracking.solvers import SolverBudget, create_solver, solver_names
from tracking.solvers.base import add_reports
from tracking.solvers.objective import total_cost
from tracking.solvers.relaxation import CLOSE_GAP
from tracking.types import Detections

TOLERANCE = 1e-9
CONFLICT_FREE = [name for name in solver_names() if name != "separate-dp"]
PERSON = np.array([20.0, 50.0])


def crowded_window(layout: float, people: int = 8, places: int = 20, frames: int = 12) -> Network:
    """People who look alike wander through each other: the relaxation is fractional, and takes long."""
    rng = np.random.default_rng(5)
    corners = rng.uniform(0.0, 150.0, (people, 2))
    templates = [
        Template(n, np.ones(1), np.hstack([corner, corner + PERSON])) for n, corner in enumerate(corners)
    ]
    seen = []
    for _ in range(frames):
        corners = corners + rng.normal(0.0, 6.0, corners.shape)
        found = np.vstack([corners, rng.uniform(0.0, 150.0, (places - people, 2))])
        boxes = np.hstack([found, found + PERSON])
        seen.append(Detections(boxes, np.ones(places), np.ones((places, 1))))
    return build_network(templates, seen, replace(PAPER_COSTS, layout=layout))


def power(name: str) -> int:
    return 2 if name == "l2" else 1


@pytest.mark.parametrize("name", CONFLICT_FREE)
@settings(deadline=None, max_examples=25)
@given(
    case=cases(objects=3, frames=4, places=3, layouts=(0.0, 0.002)),
    work_s=st.sampled_from([1e-9, 1e-4, 1e-3, 3e-3]),
)
def test_whatever_the_budget_the_answer_has_no_conflicts_and_the_bound_holds(
    name: str, case: Case, work_s: float
) -> None:
    network = network_of(case)
    solver = create_solver(name, SolverBudget(work_s))
    first, second = solver.solve(network), solver.solve(network)
    np.testing.assert_array_equal(first.states, second.states)
    report = first.report
    assert report == second.report
    assert report.conflicts == 0
    best = create_solver(name).solve(network).report
    if not best.limit and best.status == "optimal":
        assert report.bound <= best.objective + 1e-7
    assert report.objective >= best.bound - 1e-7
    everybody = np.full((network.objects, network.frames), network.max_places)
    if name != "greedy-dp":
        hidden = total_cost(network, everybody, power(name))
        assert report.objective <= hidden + TOLERANCE * max(1.0, hidden)
    if report.limit is None:
        # The ascent takes longer steps if it can afford fewer: it may end elsewhere within the gap.
        assert report == best or (network.layout and report.gap <= CLOSE_GAP)


@pytest.mark.parametrize("name", ["arcs", "columns", "exact", "l2"])
@pytest.mark.parametrize("layout", [0.0, 0.001])
def test_a_solver_that_is_stopped_says_so_and_knows_better_with_more_work(name: str, layout: float) -> None:
    network = crowded_window(layout)
    little, more = (
        create_solver(name, SolverBudget(work_s)).solve(network).report for work_s in (0.002, 0.3)
    )
    assert (little.limit, little.status) == ("work", "limit")
    assert little.skipped
    assert little.bound - TOLERANCE <= more.bound <= more.objective <= little.objective + TOLERANCE


def test_joint_states_beyond_the_budget_are_not_searched() -> None:
    network = network_of(Case(3, 5, 8, shared=True, settings=SETTINGS, seed=3))
    report = create_solver("extended-dp", SolverBudget(1e-4)).solve(network).report
    assert (report.limit, report.rounds, report.conflicts) == ("work", 0, 0)


def test_a_limit_by_the_clock_stops_the_solver(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter(np.arange(0.0, 1e6, 0.5))
    monkeypatch.setattr("tracking.solvers.budget.time.perf_counter", lambda: float(next(now)))
    report = create_solver("columns", SolverBudget(time_s=1.0)).solve(crowded_window(0.001)).report
    assert (report.limit, report.status, report.conflicts) == ("time", "limit", 0)


@pytest.mark.parametrize("limits", [{"work_s": 0.0}, {"time_s": -1.0}])
def test_a_budget_is_above_zero(limits: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="above 0"):
        SolverBudget(**limits)


def test_parts_share_a_budget_and_a_hard_one_keeps_no_other_from_being_solved() -> None:
    hard, easy = crowded_window(0.0), crowded_window(0.0, people=2, places=3, frames=4)
    solver = create_solver("columns", SolverBudget(0.02))
    first, second, third = (solution.report for solution in solver.solve_parts([hard, easy, hard]))
    assert (second.limit, second.status) == (None, "optimal")
    assert first.limit == third.limit == "work"
    assert solver.solve(hard).report.bound >= third.bound
    together = add_reports("columns", [first, second, third], rest=1.0)
    assert together.objective == pytest.approx(1.0 + first.objective + second.objective + third.objective)
    assert together.bound == pytest.approx(1.0 + first.bound + second.bound + third.bound)
    assert (together.status, together.limit, together.conflicts) == ("limit", "work", 0)
    assert not together.integral
    assert set(together.skipped) == {*first.skipped, *third.skipped}
