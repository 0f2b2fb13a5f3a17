"""The bound of the layout term: valid at all prices, and above that of the program in II.D."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.random_networks import Case, cases, network_of
from tracking.model.network import Network, Template, build_network
from tracking.model.settings import PAPER_COSTS
from tracking.solvers import SolverBudget, create_solver
from tracking.solvers.ascent.movement_prices import (
    MovementCells,
    MovementLengths,
    hiding_tolls,
    slopes_from_tensions,
)
from tracking.solvers.objective import unweighted_layout_cost
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


@settings(deadline=None, max_examples=60)
@given(case=cases(objects=4, frames=4, places=5, layouts=LAYOUTS), seed=st.integers(0, 2**32 - 1))
def test_no_paths_without_conflicts_pay_more_than_the_layout_term(case: Case, seed: int) -> None:
    """For any tensions, and any division of the term between prices and tolls."""
    network = network_of(case)
    rng = np.random.default_rng(seed)
    nodes = create_solver("greedy-dp").solve(network).states % (network.max_places + 1)
    cells = MovementCells.of(network)
    tensions = rng.normal(0.0, 2.0, (network.objects, network.frames - 1, len(cells.widths())))
    share = rng.uniform(size=network.frames - 1)
    prices = MovementLengths(network, cells).prices(slopes_from_tensions(tensions, 1.0 - share))
    prices = prices + share[:, None, None] * hiding_tolls(network)
    each, steps = np.indices(prices.shape[:2])
    paid = prices[each, steps, nodes[:, :-1], nodes[:, 1:]].sum()
    assert paid <= unweighted_layout_cost(network, nodes) + 1e-6


def test_strangers_are_proven_to_hide_where_the_program_of_all_arcs_mixes_their_paths() -> None:
    network = strangers(objects=8, places=10, frames=6)
    arcs, columns = (create_solver(name).solve(network).report for name in ("arcs", "columns"))
    assert arcs.gap > 0.02
    assert columns.gap < 0.01
    assert columns.bound > arcs.bound


def test_objects_with_observations_of_their_own_pay_no_tolls() -> None:
    network = network_of(Case(3, 4, 4, shared=False, settings=replace(PAPER_COSTS, layout=0.002), seed=1))
    assert not hiding_tolls(network).any()


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
