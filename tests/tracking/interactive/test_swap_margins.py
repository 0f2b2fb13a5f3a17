"""Swap margins: the cost of swapping two identities from some frame on."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fakes.tracking.random_networks import SETTINGS, Case, cases, network_of
from tracking.interactive import find_cheapest_swaps, swap_margin_matrix
from tracking.model.network import Network
from tracking.solvers.base import OCCLUDED, create_solver
from tracking.solvers.objective import conflict_count, nodes_from_states, total_cost


def _solved(case: Case) -> tuple[Network, np.ndarray, float]:
    network = network_of(replace(case, shared=True, settings=replace(case.settings, layout=0.0)))
    solution = create_solver("exact").solve(network)
    return network, solution.states, solution.report.objective


def _swap_from(states: np.ndarray, a: int, b: int, frame: int) -> np.ndarray:
    other = states.copy()
    other[[a, b], frame:] = states[[b, a], frame:]
    return other


@given(cases(objects=4, frames=5, places=4))
@settings(deadline=None, max_examples=60)
def test_a_margin_equals_the_cost_of_the_cheapest_swap(case: Case) -> None:
    network, states, cost = _solved(case)
    found = find_cheapest_swaps(network, states)
    for a, b in combinations(range(network.objects), 2):
        swap_costs = [
            total_cost(network, nodes_from_states(network, _swap_from(states, a, b, frame))) - cost
            for frame in range(network.frames)
            if (states[[a, b], frame:] != OCCLUDED).any()
        ]
        least = min(swap_costs, default=np.inf)
        assert found.margins[a, b] == found.margins[b, a]
        assert found.margins[a, b] == pytest.approx(least, abs=1e-9)
        if np.isfinite(least):
            swapped = _swap_from(states, a, b, int(found.frames[a, b]))
            assert total_cost(network, nodes_from_states(network, swapped)) - cost == pytest.approx(
                least, abs=1e-9
            )
            assert conflict_count(network, nodes_from_states(network, swapped)) == 0


@given(cases(objects=3, frames=4, places=3))
@settings(deadline=None, max_examples=60)
def test_a_margin_is_at_least_the_cost_of_the_best_solution_with_swapped_ends(
    case: Case,
) -> None:
    network, states, cost = _solved(case)
    margins = swap_margin_matrix(network, states)
    assert (margins >= -1e-9).all()
    for a, b in combinations(range(network.objects), 2):
        if not np.isfinite(margins[a, b]):
            continue
        node = network.node.copy()
        for one, other in ((a, b), (b, a)):
            forbidden = np.arange(network.max_places + 1) != states[other, -1] % (network.max_places + 1)
            node[one, -1, forbidden] = np.inf
        best = create_solver("exact").solve(replace(network, node=node))
        assert best.report.objective - cost <= margins[a, b] + 1e-9


@given(cases(objects=3, frames=4, places=3), st.randoms())
@settings(deadline=None, max_examples=20)
def test_margins_do_not_depend_on_the_order_of_objects(case: Case, random: object) -> None:
    network, states, _ = _solved(case)
    assume(network.objects > 1)
    order = list(range(network.objects))
    random.shuffle(order)  # type: ignore[attr-defined]
    reordered = swap_margin_matrix(network.select(order), states[order])
    np.testing.assert_allclose(
        reordered, swap_margin_matrix(network, states)[np.ix_(order, order)], atol=1e-9
    )


def test_margins_need_shared_observations() -> None:
    case = Case(2, 2, 2, shared=False, settings=replace(SETTINGS, layout=0.0), seed=4)
    network = network_of(case)
    with pytest.raises(ValueError, match="share observations"):
        find_cheapest_swaps(network, np.zeros((2, 2), dtype=np.int64))
