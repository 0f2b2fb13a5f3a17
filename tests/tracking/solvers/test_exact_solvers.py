"""The integer optimum: `exact` and `extended-dp` equal each other and exhaustive search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from fakes.tracking.random_networks import Case, cases, exhaustive_optimum, network_of
from tracking.model.network import Template, build_network
from tracking.model.settings import PAPER_COSTS
from tracking.solvers import create_solver, exact
from tracking.solvers.column_generation import solve_relaxation
from tracking.solvers.exact import JointStateSearch, branch_and_bound
from tracking.solvers.objective import conflict_count, total_cost
from tracking.solvers.solution_builder import integer_nodes
from tracking.types import Detections

TOLERANCE = 1e-9
PERSON = np.array([20.0, 50.0])
LAYOUTS = (0.0, 0.0, 0.0005, 0.002)


@pytest.mark.parametrize("name", ["exact", "extended-dp"])
@settings(deadline=None, max_examples=40)
@given(case=cases(objects=2, frames=3, places=2, layouts=LAYOUTS))
def test_the_optimum_is_found(name: str, case: Case) -> None:
    network = network_of(case)
    report = create_solver(name).solve(network).report
    assert report.objective == pytest.approx(exhaustive_optimum(network), rel=TOLERANCE)
    assert (report.gap, report.conflicts, report.status) == (0.0, 0, "optimal")


@settings(deadline=None, max_examples=60)
@given(case=cases(objects=3, frames=5, places=4, layouts=(0.0, 0.0, 0.0005)))
def test_both_exact_solvers_agree(case: Case) -> None:
    network = network_of(case)
    joint = create_solver("extended-dp").solve(network).report
    exact = create_solver("exact").solve(network).report
    assert exact.objective == pytest.approx(joint.objective, rel=TOLERANCE)


@settings(deadline=None, max_examples=40)
@given(case=cases(objects=6, frames=5, places=8))
def test_the_optimum_lies_between_the_bound_and_the_rounded_states(case: Case) -> None:
    network = network_of(case)
    relaxed = create_solver("columns").solve(network).report
    exact = create_solver("exact").solve(network).report
    assert relaxed.bound - TOLERANCE <= exact.objective <= relaxed.objective + TOLERANCE


def test_too_many_joint_states_are_refused() -> None:
    seen = Detections(np.zeros((30, 4)), np.ones(30), np.ones((30, 1)))
    network = build_network([Template(n, np.ones(1), None) for n in range(5)], [seen], PAPER_COSTS)
    with pytest.raises(ValueError, match=r"5 objects in 30 places"):
        create_solver("extended-dp").solve(network)


@settings(deadline=None, max_examples=40)
@given(case=cases(objects=3, frames=4, places=4, layouts=(0.0005, 0.002, 0.01)))
def test_joint_states_and_branching_find_the_same_optimum(case: Case) -> None:
    network = network_of(case)
    found = solve_relaxation(network)
    start = integer_nodes(network, found)
    joint = JointStateSearch(network, found).cheaper_than(total_cost(network, start))
    branched = branch_and_bound(network, found, start)
    best = start if joint is None else joint
    assert conflict_count(network, best) == 0
    assert total_cost(network, best) == pytest.approx(total_cost(network, branched), rel=TOLERANCE)


def test_where_joint_states_are_too_many_branching_finds_the_optimum(monkeypatch: pytest.MonkeyPatch) -> None:
    case = Case(3, 4, 4, shared=True, settings=replace(PAPER_COSTS, layout=0.002), seed=1)
    network = network_of(case)
    expected = create_solver("extended-dp").solve(network).report.objective
    monkeypatch.setattr(exact, "_MAX_JOINT_STATES", 1)
    monkeypatch.setattr(exact, "_MAX_TRANSITIONS", 1)
    assert create_solver("exact").solve(network).report.objective == pytest.approx(expected, rel=TOLERANCE)


def test_the_exact_solver_agrees_with_joint_states_on_two_people_in_step() -> None:
    rng = np.random.default_rng(3)
    frames = []
    for m in range(10):
        corner = np.vstack([[20.0 * m, 30.0], [20.0 * m + 40, 35.0], rng.uniform(0.0, 200.0, (6, 2))])
        histograms = rng.dirichlet(np.full(4, 20.0), 8)
        frames.append(Detections(np.hstack([corner, corner + PERSON]), np.ones(8), histograms))
    templates = [Template(n, frames[0].histograms[n], frames[0].boxes[n]) for n in range(2)]
    network = build_network(templates, frames, replace(PAPER_COSTS, layout=0.002))
    exact, joint = (create_solver(name).solve(network).report for name in ("exact", "extended-dp"))
    assert exact.objective == pytest.approx(joint.objective, rel=TOLERANCE)


def test_a_program_wrongly_presolved_as_infeasible_is_solved() -> None:
    costs = replace(PAPER_COSTS, disappearance=1.0, conflict_distance=120.0, conflict_rows="star")
    network = network_of(Case(6, 4, 8, shared=False, settings=costs, seed=304))
    found = solve_relaxation(network)
    rounded = integer_nodes(network, found)
    report = create_solver("exact").solve(network).report
    assert found.bound <= report.objective <= total_cost(network, rounded)


def test_integral_says_whether_the_relaxation_was_not_whether_the_optimum_was_found() -> None:
    case = Case(3, 4, 4, shared=True, settings=replace(PAPER_COSTS, layout=0.002), seed=1)
    network = network_of(case)
    relaxed, exact = (create_solver(name).solve(network).report for name in ("columns", "exact"))
    assert (relaxed.integral, relaxed.status) == (False, "gap")
    assert (exact.integral, exact.status) == (False, "optimal")
