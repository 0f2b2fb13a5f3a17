"""Rounding of fractional paths to integral ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings

from fakes.tracking.random_networks import Case, cases, network_of
from tracking.model.network import Network, Template, build_network
from tracking.model.settings import PAPER_COSTS
from tracking.solvers.dynamic_programming import greedy_paths
from tracking.solvers.heuristics.local_search import LocalSearch
from tracking.solvers.heuristics.rounding import is_integral, round_relaxation
from tracking.solvers.objective import conflict_count, path_cost, path_costs, total_cost
from tracking.types import Detections

many = settings(deadline=None, max_examples=60)


def two_at_one_place(*, gate: float | None = None, frames: int = 1) -> Network:
    seen = Detections(np.array([[0.0, 0, 20, 50], [200.0, 0, 220, 50]]), np.ones(2), np.ones((2, 1)))
    templates = [Template(n, np.ones(1), None) for n in range(2)]
    return build_network(templates, [seen] * frames, replace(PAPER_COSTS, gate=gate))


def test_the_largest_share_gets_the_place_and_the_other_object_its_next_best() -> None:
    usage = np.array([[[0.6, 0.3, 0.1]], [[0.5, 0.2, 0.3]]])
    assert round_relaxation(two_at_one_place(), usage).tolist() == [[0], [2]]
    usage = np.array([[[0.6, 0.3, 0.1]], [[0.5, 0.4, 0.1]]])
    assert round_relaxation(two_at_one_place(), usage).tolist() == [[0], [1]]


def test_of_equal_shares_the_first_object_gets_the_place() -> None:
    usage = np.array([[[0.5, 0.0, 0.5]], [[0.5, 0.0, 0.5]]])
    assert round_relaxation(two_at_one_place(), usage).tolist() == [[0], [2]]


def test_an_object_without_remaining_share_is_occluded() -> None:
    usage = np.array([[[0.7, 0.0, 0.3]], [[0.6, 0.4, 0.0]]])
    usage[1, 0, 1] = 0.0
    assert round_relaxation(two_at_one_place(), usage).tolist() == [[0], [2]]


def test_integral_shares_are_unchanged() -> None:
    usage = np.array([[[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]])
    assert is_integral(usage)
    assert round_relaxation(two_at_one_place(), usage).tolist() == [[0], [1]]


def test_a_jump_that_gating_forbids_is_repaired() -> None:
    network = two_at_one_place(gate=50.0, frames=2)
    jump = np.array([[0, 1], [2, 2]])
    assert np.isinf(total_cost(network, jump))
    better = LocalSearch(network).improve(jump)
    assert np.isfinite(total_cost(network, better))
    assert conflict_count(network, better) == 0


@many
@given(case=cases(objects=4, frames=4, places=4))
def test_a_path_costs_the_same_alone_as_among_others(case: Case) -> None:
    """Where motion is known, shared observations cost each object something else."""
    network = network_of(case)
    nodes = np.random.default_rng(case.seed).integers(
        0, network.max_places + 1, (network.objects, network.frames)
    )
    alone = [path_cost(network, path, owner) for owner, path in enumerate(nodes)]
    np.testing.assert_allclose(alone, path_costs(network, nodes))


@many
@given(case=cases(objects=4, frames=4, places=4, layouts=(0.0, 0.002)))
def test_any_shares_round_without_conflict_and_improving_never_raises_the_cost(case: Case) -> None:
    network = network_of(case)
    rng = np.random.default_rng(case.seed)
    usage = rng.dirichlet(np.full(network.max_places + 1, 0.5), (network.objects, network.frames))
    usage[:, :, :-1] *= network.present[network.sets]
    nodes = round_relaxation(network, usage)
    assert conflict_count(network, nodes) == 0
    better = LocalSearch(network).improve(nodes)
    assert conflict_count(network, better) == 0
    assert total_cost(network, better) <= total_cost(network, nodes)


@many
@given(case=cases(objects=4, frames=4, places=4))
def test_greedy_paths_keep_all_conflicts(case: Case) -> None:
    network = network_of(case)
    found = greedy_paths(network)
    assert conflict_count(network, found.nodes) == 0
    assert found.bound <= total_cost(network, found.nodes) + 1e-9
