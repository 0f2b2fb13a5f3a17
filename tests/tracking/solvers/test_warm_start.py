"""Warm starts: the optimum is the same with right and wrong ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.random_networks import Case, cases, network_of
from tracking.model.network import CostSettings, Network, Template, build_network
from tracking.model.settings import PAPER_COSTS
from tracking.solvers import UNKNOWN_STATE, ConflictPrice, WarmStart, create_solver
from tracking.solvers.objective import conflict_count, nodes_from_states
from tracking.types import Detections

TOLERANCE = 1e-9
PERSON = np.array([0.0, 0.0, 20.0, 50.0])
bounded = settings(deadline=None, max_examples=60)


def same_optimum(network: Network, warm_start: WarmStart) -> None:
    columns = create_solver("columns")
    cold, warm = columns.solve(network), columns.solve(network, warm_start)
    assert warm.report.bound == pytest.approx(cold.report.bound, rel=TOLERANCE, abs=TOLERANCE)
    assert conflict_count(network, nodes_from_states(network, warm.states)) == 0
    assert warm.report.objective >= warm.report.bound
    if warm.report.integral and cold.report.integral:
        assert warm.report.objective == pytest.approx(cold.report.objective, rel=TOLERANCE, abs=TOLERANCE)


@bounded
@given(case=cases(objects=6, frames=6, places=6, layouts=(0.0, 0.0, 0.002)))
def test_a_solution_as_its_own_warm_start_changes_nothing(case: Case) -> None:
    network = network_of(case)
    same_optimum(network, create_solver("columns").solve(network).warm_start)


@bounded
@given(case=cases(objects=6, frames=6, places=6), other=cases(objects=6, frames=6, places=6))
def test_the_warm_start_of_another_window_changes_nothing(case: Case, other: Case) -> None:
    same_optimum(network_of(case), create_solver("columns").solve(network_of(other)).warm_start)


@bounded
@given(case=cases(objects=5, frames=5, places=6, stars=False), seed=st.integers(0, 2**32 - 1))
def test_an_arbitrary_warm_start_changes_nothing(case: Case, seed: int) -> None:
    rng = np.random.default_rng(seed)
    network = network_of(replace(case, shared=True))
    rows = [
        ConflictPrice(
            frame=int(rng.integers(0, case.frames + 2)),
            places=tuple(sorted(set(rng.integers(0, case.places + 3, 3).tolist()))),
            price=float(rng.exponential()),
        )
        for _ in range(5)
    ]
    states = rng.integers(
        UNKNOWN_STATE, case.places + 3, (case.objects, int(rng.integers(0, case.frames + 3)))
    )
    same_optimum(network, WarmStart(tuple(rows), states))


def test_arcs_that_take_over_from_paths_keep_the_prices_for_the_next_window(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without them the next window would begin from nothing."""
    monkeypatch.setattr("tracking.solvers.column_generation._MAX_ROUNDS_SMALL_GROUP", 0)
    costs = replace(PAPER_COSTS, conflict_rows="clique", conflict_distance=120.0)
    networks = [network_of(Case(5, 6, 6, shared=True, settings=costs, seed=2 * seed)) for seed in range(4)]
    solved = [create_solver("columns").solve(network) for network in networks]
    assert all(solution.report.integral and solution.prices for solution in solved)
    again = [
        create_solver("columns").solve(network, solution.warm_start)
        for network, solution in zip(networks, solved, strict=True)
    ]
    assert all(solution.report.rounds == 0 for solution in again)


@bounded
@given(case=cases(objects=6, frames=5, places=6))
def test_the_same_warm_start_gives_the_same_solution(case: Case) -> None:
    columns, network = create_solver("columns"), network_of(case)
    warm_start = columns.solve(network).warm_start
    first, second = columns.solve(network, warm_start), columns.solve(network, warm_start)
    np.testing.assert_array_equal(first.states, second.states)
    assert first.report == second.report


@pytest.mark.parametrize("name", ["arcs", "exact", "extended-dp", "greedy-dp", "separate-dp", "l2"])
def test_other_solvers_ignore_the_warm_start(name: str) -> None:
    network, solver = rival_network(0), create_solver(name)
    first, second = (
        solver.solve(network),
        solver.solve(network, create_solver("columns").solve(network).warm_start),
    )
    np.testing.assert_array_equal(first.states, second.states)


def test_a_shifted_warm_start_has_the_new_frame_and_object_indices() -> None:
    rows = (ConflictPrice(0, (1, 2), 0.5), ConflictPrice(2, (0, 1), 0.25))
    warm_start = WarmStart(rows, np.array([[0, 1, 2], [3, 4, -1]])).shift(2, [1, None, 0])
    assert warm_start.rows == (ConflictPrice(0, (0, 1), 0.25),)
    assert warm_start.states.tolist() == [[-1], [UNKNOWN_STATE], [2]]


def rival_network(first: int, frames: int = 6) -> Network:
    """Two similar people stand apart; in frame 3 only one is detected, and both compete for the box."""
    boxes = np.array([PERSON, PERSON + np.array([60.0, 0.0, 60.0, 0.0])])

    def seen(frame: int) -> Detections:
        count = 1 if frame == 3 else 2
        return Detections(boxes[:count], np.ones(count), np.ones((count, 1)))

    templates = [Template(n, np.ones(1), boxes[n]) for n in range(2)]
    return build_network(templates, [seen(first + m) for m in range(frames)], costs())


def costs() -> CostSettings:
    return replace(PAPER_COSTS, displacement=0.003, conflict_distance=60.0, conflict_rows="clique")


def test_if_the_old_prices_hold_no_program_is_solved() -> None:
    columns = create_solver("columns")
    before = columns.solve(rival_network(0))
    assert before.report.rounds > 0, "both objects must compete for the same boxes"
    after = columns.solve(rival_network(1), before.warm_start.shift(1, [0, 1]))
    assert after.report.rounds == 0
    assert after.report.objective == pytest.approx(
        columns.solve(rival_network(1)).report.objective, rel=TOLERANCE
    )


def test_reports_are_equal_regardless_of_solving_time() -> None:
    first, second = (create_solver("columns").solve(rival_network(0)).report for _ in range(2))
    assert first.seconds > 0.0
    assert replace(first, seconds=1.0) == replace(second, seconds=2.0)
