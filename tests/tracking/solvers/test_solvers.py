"""Properties of all solvers, on random windows and compared with exhaustive search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from fakes.tracking.random_networks import SETTINGS, Case, cases, exhaustive_optimum, network_of
from tracking.model.network import Template, build_network
from tracking.model.settings import PAPER_COSTS
from tracking.solvers import OCCLUDED, Solution, create_solver
from tracking.solvers.objective import conflict_count, nodes_from_states, total_cost
from tracking.types import Detections

TOLERANCE = 1e-9
RELAXATIONS = ("arcs", "columns")
CONFLICT_FREE = (*RELAXATIONS, "greedy-dp")
bounded = settings(deadline=None, max_examples=60)
NEAR = replace(SETTINGS, conflict_distance=120.0)
HIDING_IS_CHEAPER = Case(3, 4, 3, shared=True, settings=replace(NEAR, layout=0.01), seed=110)
"""A window whose rounded relaxation is dearer than hiding everybody."""
MUST_BE_VISIBLE = Case(3, 3, 3, shared=True, settings=NEAR, seed=125)
"""A window in which all objects cannot be hidden at once, if that is forbidden in half of the frames."""


def solved(case: Case, name: str) -> Solution:
    return create_solver(name).solve(network_of(case))


def test_an_unknown_solver_is_refused_with_the_known_names() -> None:
    with pytest.raises(ValueError, match=r"'simplex'.*arcs, columns"):
        create_solver("simplex")


@pytest.mark.parametrize("name", CONFLICT_FREE)
@bounded
@given(case=cases(layouts=(0.0, 0.002)))
def test_states_exist_and_keep_all_conflicts(name: str, case: Case) -> None:
    network = network_of(case)
    solution = create_solver(name).solve(network)
    nodes = nodes_from_states(network, solution.states)
    assert solution.states.shape == (network.objects, network.frames)
    assert solution.states.dtype == np.int64
    assert solution.states.min(initial=OCCLUDED) >= OCCLUDED
    assert solution.report.objective == pytest.approx(total_cost(network, nodes), rel=TOLERANCE)
    assert np.isfinite(solution.report.objective)
    assert conflict_count(network, nodes) == solution.report.conflicts == 0


@pytest.mark.parametrize("name", [*CONFLICT_FREE, "separate-dp"])
@settings(deadline=None, max_examples=30)
@given(case=cases(objects=2, frames=3, places=2, layouts=(0.0, 0.002)))
def test_the_bound_is_below_the_optimum_and_integral_relaxations_are_optimal(name: str, case: Case) -> None:
    network = network_of(case)
    optimum = exhaustive_optimum(network)
    report = create_solver(name).solve(network).report
    assert report.bound <= optimum + TOLERANCE
    if report.conflicts == 0:
        assert report.objective >= optimum - TOLERANCE
    if report.integral or report.status == "optimal":
        assert report.objective == pytest.approx(optimum, rel=TOLERANCE)
        assert report.gap < TOLERANCE


@pytest.mark.parametrize("name", [*RELAXATIONS, "exact"])
@settings(deadline=None, max_examples=60)
@given(case=cases(objects=4, frames=4, places=4, layouts=(0.0, 0.002, 0.01)))
@example(case=HIDING_IS_CHEAPER)
def test_no_answer_is_dearer_than_hiding_everybody(name: str, case: Case) -> None:
    network = network_of(case)
    everybody = np.full((network.objects, network.frames), network.max_places)
    hidden = total_cost(network, everybody)
    assert create_solver(name).solve(network).report.objective <= hidden + TOLERANCE * max(1.0, hidden)


@pytest.mark.parametrize("name", ["arcs", "columns", "exact", "extended-dp"])
@settings(deadline=None, max_examples=40)
@example(case=MUST_BE_VISIBLE, share=0.5)
@given(case=cases(objects=3, frames=3, places=3), share=st.sampled_from([0.2, 0.5, 0.9]))
def test_objects_that_may_not_be_hidden_have_the_answer_of_all_arcs(
    name: str, case: Case, share: float
) -> None:
    network = network_of(case)
    node = network.node.copy()
    forbidden = np.random.default_rng(case.seed).uniform(size=node.shape[:2]) < share
    node[:, :, -1][forbidden] = np.inf
    network = replace(network, node=node)
    joint = create_solver("extended-dp").solve(network).report
    optimum = joint.objective
    assume(np.isfinite(optimum) and not joint.conflicts)
    report = create_solver(name).solve(network).report
    assert (np.isfinite(report.objective), report.conflicts) == (True, 0)
    assert report.bound <= optimum + TOLERANCE <= report.objective + 2.0 * TOLERANCE
    if name == "exact":
        assert report.objective == pytest.approx(optimum, rel=TOLERANCE)


@pytest.mark.parametrize("name", ["arcs", "columns", "exact", "extended-dp", "greedy-dp"])
@settings(deadline=None, max_examples=40)
@given(case=cases(objects=3, frames=2, places=2), share=st.sampled_from([0.2, 0.5, 0.8]))
def test_forbidden_nodes_are_avoided_or_the_report_has_conflicts(name: str, case: Case, share: float) -> None:
    network = network_of(case)
    forbidden = np.random.default_rng(case.seed).uniform(size=network.node.shape) < share
    network = replace(network, node=np.where(forbidden, np.inf, network.node))
    optimum = exhaustive_optimum(network)
    assume(np.isfinite(optimum))
    found = create_solver(name).solve(network)
    assert found.report.conflicts == conflict_count(network, nodes_from_states(network, found.states))
    if not found.report.conflicts:
        assert found.report.objective >= optimum - TOLERANCE
    if name != "greedy-dp":
        assert not found.report.conflicts
        assert np.isfinite(found.report.objective)
    if name == "extended-dp" or found.report.integral:
        assert found.report.objective == pytest.approx(optimum, rel=TOLERANCE)


def test_greedy_ends_if_no_object_has_a_path() -> None:
    network = network_of(Case(3, 3, 2, shared=True, settings=SETTINGS, seed=1))
    found = create_solver("greedy-dp").solve(replace(network, node=np.full_like(network.node, np.inf)))
    assert np.isinf(found.report.objective)


@settings(deadline=None, max_examples=25)
@given(case=cases(objects=3, frames=2, places=2))
def test_three_objects_get_the_optimum_if_the_relaxation_is_integral(case: Case) -> None:
    network = network_of(case)
    optimum = exhaustive_optimum(network)
    for name in RELAXATIONS:
        report = create_solver(name).solve(network).report
        assert report.bound <= optimum + TOLERANCE
        assert not report.integral or report.objective == pytest.approx(optimum, rel=TOLERANCE)


@settings(deadline=None, max_examples=150)
@given(case=cases(objects=6, frames=6, places=6))
def test_columns_finds_the_optimum_of_all_arcs(case: Case) -> None:
    columns, arcs = solved(case, "columns").report, solved(case, "arcs").report
    assert columns.bound == pytest.approx(arcs.bound, rel=TOLERANCE, abs=TOLERANCE)
    if columns.integral and arcs.integral:
        assert columns.objective == pytest.approx(arcs.objective, rel=TOLERANCE, abs=TOLERANCE)


@pytest.mark.parametrize("name", [*CONFLICT_FREE, "separate-dp"])
@settings(deadline=None, max_examples=10)
@given(case=cases(objects=4, frames=4, places=4))
def test_the_same_window_gives_the_same_states(name: str, case: Case) -> None:
    first, second = solved(case, name), solved(case, name)
    np.testing.assert_array_equal(first.states, second.states)
    assert first.report == second.report


@settings(deadline=None, max_examples=15)
@given(case=cases(objects=20, frames=5, places=12), crowd=st.integers(13, 20))
def test_columns_finds_the_optimum_of_crowds(case: Case, crowd: int) -> None:
    crowded = replace(case, objects=crowd, places=12, shared=True)
    columns, arcs = solved(crowded, "columns").report, solved(crowded, "arcs").report
    assert columns.bound == pytest.approx(arcs.bound, rel=TOLERANCE, abs=TOLERANCE)


def test_columns_finds_the_optimum_of_many_small_groups() -> None:
    """Ten pairs far from each other; in the middle frame one box of each pair is missing."""
    lefts = np.array([left for pair in range(10) for left in (500.0 * pair, 500.0 * pair + 60.0)])
    boxes = np.column_stack([lefts, np.zeros(20), lefts + 20.0, np.full(20, 50.0)])

    def seen(frame: int) -> Detections:
        visible = boxes[::2] if frame == 2 else boxes
        return Detections(visible, np.ones(len(visible)), np.ones((len(visible), 1)))

    templates = [Template(n, np.ones(1), boxes[n]) for n in range(20)]
    network = build_network(templates, [seen(m) for m in range(5)], replace(PAPER_COSTS, displacement=0.003))
    columns, arcs = (create_solver(name).solve(network).report for name in RELAXATIONS)
    assert columns.rounds > 0
    assert columns.bound == pytest.approx(arcs.bound, rel=TOLERANCE)
    assert columns.integral
