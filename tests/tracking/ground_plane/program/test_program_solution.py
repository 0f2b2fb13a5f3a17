"""A program solved as a flow, or in parts, has the answer of one network over everybody and all places."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.undivided_window import Window, random_window, undivided_network
from tracking.ground_plane.program.parts import divide
from tracking.ground_plane.program.program_flow import ProgramFlow
from tracking.ground_plane.program.solution import ProgramSolution, solve_by_parts, solve_program
from tracking.ground_plane.program.useful_arcs import GONE, HIDDEN, unseen_paths, useful_arcs
from tracking.solvers import SolverBudget, create_solver
from tracking.solvers.objective import conflict_count, total_cost
from tracking.solvers.programs.linear_program import solve_program as solve_linear_program

NEWCOMERS = 6
TOLERANCE = 1e-6
windows = st.builds(
    random_window,
    seed=st.integers(0, 2**32 - 1),
    people=st.just(3),
    frames=st.just(3),
    places=st.just(4),
    width=st.sampled_from([1.0, 4.0, 12.0]),
)


def solve(window: Window, solver: str = "exact", budget: SolverBudget | None = None) -> ProgramSolution:
    return solve_program(window.costs(), window.frames, create_solver(solver, budget))


def solve_in_parts(window: Window, solver: str = "exact") -> ProgramSolution:
    costs = window.costs()
    unseen = unseen_paths(costs)
    conflicts = [places.conflicts for places in window.frames]
    return solve_by_parts(useful_arcs(costs, unseen), conflicts, unseen, create_solver(solver))


def flow_states(window: Window) -> np.ndarray | None:
    costs = window.costs()
    flow = ProgramFlow(
        useful_arcs(costs, unseen_paths(costs)), [places.conflicts for places in window.frames]
    )
    return flow.states(solve_linear_program(flow.program).values)


def with_gone(states: np.ndarray, gone: int) -> np.ndarray:
    """Return the states of an undivided network with `GONE` in place of the last place."""
    return np.where(states == gone, GONE, states)


def nodes_of(window: Window, states: np.ndarray) -> np.ndarray:
    """Return the nodes of the undivided network of a program's states, with newcomers who never arrive."""
    gone = max(len(places) for places in window.frames)
    missing = len(window.people) + NEWCOMERS - len(states)
    waiting = np.full((missing, states.shape[1]), HIDDEN)
    found = np.concatenate([states, waiting])
    return np.where(found == GONE, gone, np.where(found == HIDDEN, gone + 1, found))


def arrivals(states: np.ndarray, known: int) -> list[list[int]]:
    """Return the states of the newcomers who arrive, in any order."""
    return sorted(row.tolist() for row in states[known:] if (row >= 0).any())


@settings(deadline=None, max_examples=150)
@given(window=windows, solving=st.sampled_from([solve, solve_in_parts]))
def test_flows_and_parts_have_the_cost_and_the_states_of_the_whole(
    window: Window, solving: Callable[[Window], ProgramSolution]
) -> None:
    network = undivided_network(window, NEWCOMERS)
    whole, parts = create_solver("exact").solve(network), solving(window)
    assert parts.report.status == "optimal"
    assert parts.report.objective == pytest.approx(whole.report.objective, abs=TOLERANCE)
    nodes = nodes_of(window, parts.states)
    assert conflict_count(network, nodes) == 0
    assert total_cost(network, nodes) == pytest.approx(parts.report.objective, abs=TOLERANCE)
    # Costs are drawn, so that no two answers cost the same.
    known, states = len(window.people), with_gone(whole.states, network.max_places - 1)
    np.testing.assert_array_equal(parts.states[:known], states[:known])
    assert arrivals(parts.states, known) == arrivals(states, known)


@settings(deadline=None, max_examples=50)
@given(window=windows, solver=st.sampled_from(["arcs", "columns"]))
def test_parts_prove_what_the_whole_proves(window: Window, solver: str) -> None:
    whole = create_solver(solver).solve(undivided_network(window, NEWCOMERS)).report
    parts = solve_in_parts(window, solver).report
    assert parts.bound >= whole.bound - TOLERANCE
    assert parts.bound <= parts.objective
    assert parts.integral or not whole.integral
    assert parts.conflicts == 0
    assert (parts.solver, parts.limit, parts.skipped) == (solver, None, ())


@pytest.mark.parametrize("seed", [7, 46, 288, 435])
def test_where_the_relaxation_is_fractional_the_answer_is_the_optimum_of_the_whole(seed: int) -> None:
    window = random_window(seed, people=4, frames=4, places=6, width=[1.0, 2.0, 4.0][seed % 3])
    assert flow_states(window) is None
    whole = create_solver("exact").solve(undivided_network(window, NEWCOMERS))
    assert solve(window).report.objective == pytest.approx(whole.report.objective, abs=TOLERANCE)


@settings(deadline=None, max_examples=50)
@given(window=windows, work_s=st.sampled_from([1e-9, 1e-5, 1e-3]))
def test_whatever_the_budget_the_answer_has_no_conflicts_and_the_bound_holds(
    window: Window, work_s: float
) -> None:
    first, second = (solve(window, "columns", SolverBudget(work_s)) for _ in range(2))
    np.testing.assert_array_equal(first.states, second.states)
    assert first.report == second.report
    best = solve(window).report.objective
    assert first.report.bound <= best + TOLERANCE
    assert first.report.objective >= best - TOLERANCE
    nodes = nodes_of(window, first.states)
    network = undivided_network(window, len(nodes) - len(window.people))
    assert conflict_count(network, nodes) == first.report.conflicts == 0
    assert total_cost(network, nodes) == pytest.approx(first.report.objective, abs=TOLERANCE)


@settings(deadline=None, max_examples=100)
@given(window=windows)
def test_parts_have_nothing_in_common(window: Window) -> None:
    costs = window.costs()
    unseen = unseen_paths(costs)
    parts = divide(useful_arcs(costs, unseen), [places.conflicts for places in window.frames])
    people = np.concatenate([part.people for part in parts]) if parts else np.zeros(0)
    assert len(np.unique(people)) == len(people)
    for m, places in enumerate(window.frames):
        owner = np.full(len(places), -1)
        for index, part in enumerate(parts):
            assert (owner[part.places[m]] == -1).all()
            owner[part.places[m]] = index
        one, other = np.nonzero(places.conflicts)
        both = (owner[one] >= 0) & (owner[other] >= 0)
        assert (owner[one] == owner[other])[both].all()


def test_people_far_apart_are_parts_of_their_own() -> None:
    divided = [random_window(seed, people=3, frames=3, places=4, width=120.0) for seed in range(50)]
    sizes = []
    for window in divided:
        costs = window.costs()
        parts = divide(costs, [places.conflicts for places in window.frames])
        sizes += [len(part.people) + sum(map(len, part.places)) for part in parts]
    assert max(sizes) < 8 < len(sizes) / 10
