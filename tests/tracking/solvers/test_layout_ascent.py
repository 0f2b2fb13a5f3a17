"""The bound of the layout term: valid at all prices, and above that of the program in II.D."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.random_networks import Case, cases, network_of
from tracking.model.network import Network, Template, build_network
from tracking.model.settings import PAPER_COSTS
from tracking.solvers import SolverBudget, create_solver
from tracking.solvers.ascent.leap_tolls import leap_tolls
from tracking.solvers.ascent.movement_prices import (
    MovementCells,
    MovementLengths,
    MovementPrices,
    slopes_from_tensions,
)
from tracking.solvers.budget import BudgetMeter
from tracking.solvers.heuristics.recombination import recombine
from tracking.solvers.hidden_paths import allow_hiding, hidden_nodes
from tracking.solvers.objective import conflict_count, total_cost, unweighted_layout_cost
from tracking.solvers.sparse_trellis import SparseTrellis
from tracking.types import Detections

TOLERANCE = 1e-9
LAYOUTS = (0.0005, 0.002, 0.01)
PERSON = np.array([28.0, 70.0])


def strangers(objects: int, places: int, frames: int) -> Network:
    """People and boxes at random places: nobody walks from one box to the next."""
    rng = np.random.default_rng(2)

    def seen(count: int) -> Detections:
        corners = rng.uniform(0.0, 300.0, (count, 2))
        return Detections(
            np.hstack([corners, corners + PERSON]), np.ones(count), rng.dirichlet(np.ones(16), count)
        )

    first = seen(objects)
    templates = [Template(n, first.histograms[n], box) for n, box in enumerate(first.boxes)]
    costs = replace(PAPER_COSTS, conflict_rows="clique", layout=0.001)
    return build_network(templates, [seen(places) for _ in range(frames)], costs)


@settings(deadline=None, max_examples=60)
@given(case=cases(objects=4, frames=4, places=3, layouts=LAYOUTS), work_s=st.sampled_from([None, 1e-3, 2e-2]))
def test_the_bound_is_below_the_optimum_whatever_the_budget(case: Case, work_s: float | None) -> None:
    network = network_of(case)
    optimum = create_solver("extended-dp").solve(network).report.objective
    budget = SolverBudget(work_s) if work_s else None
    report = create_solver("columns", budget).solve(network).report
    assert report.bound <= optimum + TOLERANCE
    assert report.objective >= optimum - TOLERANCE


@settings(deadline=None, max_examples=100)
@given(case=cases(objects=4, frames=4, places=5, layouts=LAYOUTS), seed=st.integers(0, 2**32 - 1))
def test_no_paths_without_conflicts_pay_more_than_the_layout_term(case: Case, seed: int) -> None:
    """For any tensions, and any division of the term between prices and tolls."""
    network = allow_hiding(network_of(case))
    if network.frames == 1:
        return
    rng = np.random.default_rng(seed)
    nodes = create_solver("greedy-dp").solve(network).states % (network.max_places + 1)
    cells, trellis = MovementCells.of(network), SparseTrellis.of(network)
    tensions = rng.normal(0.0, 2.0, (network.objects, network.frames - 1, len(cells.widths())))
    share = rng.uniform(size=network.frames - 1)
    slopes = slopes_from_tensions(tensions, 1.0 - share[:, None] * cells.are_leaps())
    movement_prices = MovementPrices.of(cells, trellis, network.locations)
    prices, single = movement_prices.of_slopes(slopes), MovementLengths(movement_prices)
    np.testing.assert_allclose(single.prices(slopes.astype(np.float32)), prices, rtol=1e-4, atol=1e-2)
    prices = trellis.dense(prices + share[trellis.step] * leap_tolls(network, trellis, cells.leap))
    each, steps = np.indices(prices.shape[:2])
    paid = prices[each, steps, nodes[:, :-1], nodes[:, 1:]].sum()
    assert paid <= unweighted_layout_cost(network, nodes) + 1e-6


def test_strangers_are_proven_to_hide_where_the_program_of_all_arcs_mixes_their_paths() -> None:
    network = strangers(objects=8, places=10, frames=6)
    arcs, columns = (create_solver(name).solve(network).report for name in ("arcs", "columns"))
    assert arcs.gap > 0.02
    assert columns.gap < 0.01
    assert columns.bound > arcs.bound


def test_who_leaps_out_of_hiding_pays_for_it_but_not_with_observations_of_their_own() -> None:
    for shared in (True, False):
        costs = replace(PAPER_COSTS, layout=0.002)
        network = network_of(Case(3, 4, 4, shared=shared, settings=costs, seed=1))
        trellis = SparseTrellis.of(network)
        tolls = leap_tolls(network, trellis, leap=1.0)
        appears = (trellis.origin == network.max_places) & (trellis.target < network.max_places)
        assert (tolls[appears] > 0.0).any() == shared
        assert not tolls[
            (trellis.origin == network.max_places) == (trellis.target == network.max_places)
        ].any()


def walkers(objects: int, frames: int) -> Network:
    """People who walk apart; some boxes are missing, and their people would have to hide and reappear."""
    rng = np.random.default_rng(4)
    looks = rng.dirichlet(np.full(16, 0.5), objects)
    corners, speeds = rng.uniform(0.0, 400.0, (objects, 2)), rng.normal(0.0, 3.0, (objects, 2))

    def boxes(at: np.ndarray) -> np.ndarray:
        return np.hstack([at, at + PERSON])

    templates = [Template(n, looks[n], box) for n, box in enumerate(boxes(corners))]
    seen = []
    for _ in range(frames):
        corners = corners + speeds
        found = np.flatnonzero(rng.uniform(size=objects) < 0.9)
        stray = rng.uniform(0.0, 400.0, (objects, 2))
        at = np.vstack([corners[found] + rng.normal(0.0, 2.0, (len(found), 2)), stray])
        appearance = np.vstack([looks[found], looks[rng.permutation(objects)]])
        seen.append(Detections(boxes(at), np.ones(len(at)), appearance))
    costs = replace(PAPER_COSTS, conflict_rows="clique", layout=0.001, gate=60.0)
    return build_network(templates, seen, costs)


def test_walkers_in_a_crowd_are_solved_to_within_two_percent() -> None:
    assert create_solver("columns").solve(walkers(objects=12, frames=10)).report.gap < 0.02


@settings(deadline=None, max_examples=60)
@given(case=cases(objects=3, frames=3, places=3, layouts=LAYOUTS), known=st.integers(1, 4))
def test_recombined_paths_have_no_conflicts_and_are_the_best_of_two_objects(case: Case, known: int) -> None:
    network = allow_hiding(network_of(case))
    rng = np.random.default_rng(case.seed)
    hidden = hidden_nodes(network)
    paths = [hidden, *(rng.integers(0, network.max_places + 1, (known, *hidden.shape)))]
    found = recombine(network, paths, 1, BudgetMeter())
    assert conflict_count(network, found) == 0
    assert total_cost(network, found) <= total_cost(network, hidden) + TOLERANCE
    choices = (np.array(choice) for choice in product(range(len(paths)), repeat=network.objects))
    each = np.arange(network.objects)
    answers = (np.array(paths)[choice, each] for choice in choices)
    costs = [total_cost(network, nodes) for nodes in answers if conflict_count(network, nodes) == 0]
    assert total_cost(network, found) >= min(costs) - TOLERANCE
    if network.objects <= 2:
        assert total_cost(network, found) == pytest.approx(min(costs))


def test_lengths_add_up_to_the_movement() -> None:
    cells = MovementCells.of(strangers(objects=2, places=3, frames=2))
    movement = np.array([-500.0, 3.0, 0.0, 41.5])
    np.testing.assert_allclose(cells.lengths(movement).reshape(4, -1).sum(axis=1), movement)


@pytest.mark.parametrize("shared", [True, False])
def test_the_same_window_and_budget_give_the_same_bound(shared: bool) -> None:
    network = network_of(Case(4, 4, 4, shared=shared, settings=replace(PAPER_COSTS, layout=0.002), seed=1))
    first, second = (create_solver("columns", SolverBudget(0.02)).solve(network) for _ in range(2))
    assert first.report == second.report
    np.testing.assert_array_equal(first.states, second.states)
