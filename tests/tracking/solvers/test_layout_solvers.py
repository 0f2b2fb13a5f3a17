"""The layout term: L1 in `arcs`, `columns` and `exact`, the square of L2 in `l2`."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, settings

from fakes.tracking.random_networks import SETTINGS, Case, cases, network_of
from tracking.model.network import Network, Template, build_network
from tracking.model.settings import PAPER_COSTS
from tracking.solvers import create_solver
from tracking.solvers.cutting_planes import ConflictSeparator
from tracking.solvers.objective import conflict_count, total_cost, unweighted_layout_cost
from tracking.solvers.programs.arc_master import ArcMaster, ArcSet
from tracking.types import Detections

SQUARE = 2
PERSON = np.array([0.0, 0.0, 20.0, 50.0])


def best_square_by_trying(network: Network) -> float:
    best = np.inf
    for flat in product(range(network.max_places + 1), repeat=network.objects * network.frames):
        nodes = np.array(flat).reshape(network.objects, network.frames)
        cost = total_cost(network, nodes, SQUARE)
        if cost < best and conflict_count(network, nodes) == 0:
            best = cost
    return best


ILL_CONDITIONED = replace(SETTINGS, gate=40.0, layout=1e-4, conflict_distance=120.0)
REGULARIZATION_FAILS = Case(3, 2, 2, shared=True, settings=ILL_CONDITIONED, seed=1537)
"""A window whose quadratic program failed in HiGHS if it was regularized."""


@settings(deadline=None, max_examples=40)
@given(case=cases(objects=3, frames=2, places=2, layouts=(1e-5, 1e-4)))
@example(case=REGULARIZATION_FAILS)
def test_the_l2_bound_is_below_the_optimum_and_integral_relaxations_attain_it(case: Case) -> None:
    network = network_of(case)
    report = create_solver("l2").solve(network).report
    optimum = best_square_by_trying(network)
    assert report.bound <= optimum + 1e-6
    assert report.objective >= optimum - 1e-9
    assert report.conflicts == 0
    if report.integral:
        assert report.objective == pytest.approx(optimum, rel=1e-6)


def tied_window(seed: int) -> Network:
    """Four people who look alike, at few places in whole coordinates."""
    rng = np.random.default_rng(seed)
    frames = []
    for _ in range(3):
        corner = rng.integers(0, 3, (4, 2)) * 40.0
        boxes = np.hstack([corner, corner + np.array([20.0, 50.0])])
        frames.append(Detections(boxes, np.ones(4), np.ones((4, 1))))
    templates = [Template(n, np.ones(1), None) for n in range(4)]
    return build_network(templates, frames, replace(PAPER_COSTS, layout=0.002))


def all_arcs(network: Network) -> ArcSet:
    """Return the arcs between all states of all objects."""
    n, m, i, j = (index.ravel() for index in np.indices((*network.node.shape, network.max_places + 1)))
    first = (m == 0) & (i == 0)
    arcs = ArcSet(n, m, i, j).select(first | (m > 0))
    exists = np.isfinite(network.node[arcs.owner, arcs.frame, arcs.target])
    before = np.maximum(arcs.frame - 1, 0)
    pair = network.pair[network.pair_sets[arcs.owner], before, arcs.origin, arcs.target]
    source = network.source[arcs.owner, arcs.target]
    return arcs.select(exists & np.isfinite(np.where(arcs.frame == 0, source, pair)))


@pytest.mark.parametrize("seed", range(8))
def test_tied_windows_are_solved_to_the_optimum_of_all_arcs(seed: int) -> None:
    """HiGHS' solver of quadratic programs cycles on most of them."""
    network = tied_window(seed)
    report = create_solver("l2").solve(network).report
    program = ArcMaster(network)
    program.add_arcs(all_arcs(network))
    separator = ConflictSeparator(network)
    optimum = program.solve().objective
    while rows := separator.find_new_violated(program.usage()):
        program.add_rows(rows)
        optimum = program.solve().objective
    assert report.bound == pytest.approx(optimum, rel=1e-7)
    assert report.bound <= report.objective
    assert report.conflicts == 0


@settings(deadline=None, max_examples=40)
@given(case=cases(objects=4, frames=4, places=4, layouts=(1e-5, 1e-4, 0.002)))
def test_no_l2_answer_is_dearer_than_hiding_everybody(case: Case) -> None:
    network = network_of(case)
    everybody = np.full((network.objects, network.frames), network.max_places)
    hidden = total_cost(network, everybody, SQUARE)
    assert create_solver("l2").solve(network).report.objective <= hidden * (1.0 + 1e-9)


@settings(deadline=None, max_examples=20)
@given(case=cases(objects=4, frames=4, places=4))
def test_without_layout_l2_equals_columns(case: Case) -> None:
    network = network_of(case)
    columns, squares = create_solver("columns").solve(network), create_solver("l2").solve(network)
    np.testing.assert_array_equal(columns.states, squares.states)


def side_by_side(layout: float) -> Network:
    """Two people walk in step; in the last frame the second may stay, where its appearance fits better."""
    dark, gray = np.array([1.0, 0.0]), np.array([0.97, 0.03])

    def at(*lefts: float, histograms: tuple[np.ndarray, ...]) -> Detections:
        boxes = np.array([PERSON + np.array([left, 0.0, left, 0.0]) for left in lefts])
        return Detections(boxes, np.ones(len(boxes)), np.array(histograms))

    frames = [
        at(0.0, 100.0, histograms=(dark, dark)),
        at(30.0, 130.0, histograms=(dark, dark)),
        at(60.0, 160.0, 130.0, histograms=(dark, gray, dark)),
    ]
    first = frames[0].boxes
    templates = [Template(n, dark, first[n]) for n in range(2)]
    return build_network(templates, frames, replace(replace(PAPER_COSTS, displacement=1e-4), layout=layout))


@pytest.mark.parametrize("name", ["arcs", "columns", "exact", "extended-dp"])
def test_the_layout_term_keeps_people_in_step(name: str) -> None:
    apart = create_solver(name).solve(side_by_side(layout=0.0))
    together = create_solver(name).solve(side_by_side(layout=0.01))
    assert apart.states[1].tolist() == [1, 1, 2]
    assert together.states[1].tolist() == [1, 1, 1]


def test_a_step_of_one_object_costs_its_pixels_on_every_side() -> None:
    network = side_by_side(layout=0.01)
    nodes = np.array([[0, 0, 0], [1, 1, 2]])
    assert unweighted_layout_cost(network, nodes) == 2 * 30.0
    assert unweighted_layout_cost(network, nodes, SQUARE) == 2 * 30.0**2
