"""Arcs in lists: the same passes and paths as over all pairs of states."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.random_networks import Case, cases, network_of
from tracking.model.network import Network
from tracking.solvers import viterbi
from tracking.solvers.ascent.soft_paths import SoftPaths
from tracking.solvers.cutting_planes import ConflictRow, RowMembers
from tracking.solvers.dynamic_programming import greedy_paths
from tracking.solvers.heuristics.local_search import LocalSearch, MovementChanges
from tracking.solvers.hidden_paths import allow_hiding
from tracking.solvers.objective import conflict_count, path_costs, total_cost
from tracking.solvers.sparse_trellis import SparseTrellis
from tracking.solvers.viterbi import MinMarginals, Trellis, backward, best_paths, forward

many = settings(deadline=None, max_examples=100)


def window(case: Case) -> Network | None:
    """Return the window, None if it has no step between frames."""
    network = allow_hiding(network_of(case))
    return network if network.frames > 1 else None


@many
@given(case=cases(objects=4, frames=5, places=5))
def test_passes_over_lists_equal_those_over_all_pairs_of_states(case: Case) -> None:
    if (network := window(case)) is None:
        return
    trellis = SparseTrellis.of(network)
    passes = MinMarginals.of(Trellis.of(network))
    forward, backward = trellis.forward(trellis.costs), trellis.backward(trellis.costs)
    through = np.where(np.isfinite(passes.through), passes.through, np.inf)
    np.testing.assert_allclose(np.swapaxes(forward + backward, 0, 1), through)
    found, expected = trellis.best_paths(trellis.costs), best_paths(Trellis.of(network))
    np.testing.assert_allclose(found.costs, expected.costs)
    np.testing.assert_allclose(path_costs(network, found.nodes), expected.costs)


@many
@given(case=cases(objects=4, frames=5, places=5), barred=st.floats(0.0, 1.0))
def test_a_trellis_with_lists_has_the_same_passes_and_paths_to_the_last_bit(
    case: Case, barred: float
) -> None:
    """Whatever arcs are missing, even all of a step, and for some of the objects and other nodes, too."""
    network, rng = network_of(case), np.random.default_rng(case.seed)
    network = replace(network, pair=np.where(rng.random(network.pair.shape) < barred, np.inf, network.pair))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(viterbi, "_MOST_LISTED", 1.0)
        patch.setattr(viterbi, "_LEAST_OBJECTS", 1)
        patch.setattr(viterbi, "_LEAST_STATES", 1)
        listed = Trellis.of(network)
    assert (listed.listed is not None) == (network.frames > 1)
    some = np.flatnonzero(rng.random(network.objects) < 0.7)
    for one in (listed, listed.select(some), listed.with_node(network.node + rng.random(network.node.shape))):
        plain = replace(one, listed=None)
        np.testing.assert_array_equal(forward(one), forward(plain))
        through = forward(plain) + backward(plain)
        np.testing.assert_array_equal(forward(one) + backward(one), through)
        np.testing.assert_array_equal(best_paths(one).nodes, best_paths(plain).nodes)
        np.testing.assert_array_equal(forward(one, forward(plain)[:2]), forward(plain))


@many
@given(case=cases(objects=4, frames=3, places=5), seed=st.integers(0, 2**32 - 1))
def test_members_of_rows_are_those_of_each_row(case: Case, seed: int) -> None:
    network, rng = network_of(case), np.random.default_rng(seed)
    rows = [
        ConflictRow(frame, np.pad(row, ((0, 0), (0, 1))))
        for frame in range(network.frames)
        for row in network.rows(frame)
    ]
    members = RowMembers(network)
    members.add(rows[:2])
    members.add(rows[2:])
    owners = rng.integers(0, network.objects, 6)
    nodes = rng.integers(0, network.max_places + 1, (6, network.frames))
    inside = [row.members[owners, nodes[:, row.frame]] for row in rows]
    np.testing.assert_array_equal(members.of_paths(owners, nodes), np.reshape(inside, (len(rows), 6)).T)
    prices = rng.random(len(rows)) * rng.integers(0, 2, len(rows))
    priced = network.node.copy()
    for row, price in zip(rows, prices, strict=True):
        priced[:, row.frame][row.members] += price
    np.testing.assert_allclose(members.add_prices(network.node, prices), priced)


@many
@given(case=cases(objects=3, frames=4, places=4), share=st.floats(0.0, 2.0))
def test_arcs_whose_excess_is_above_a_limit_are_on_no_path_within_it(case: Case, share: float) -> None:
    if (network := window(case)) is None:
        return
    trellis = SparseTrellis.of(network)
    excess = trellis.excess(trellis.costs, trellis.forward(trellis.costs), trellis.backward(trellis.costs))
    assert excess.min() == pytest.approx(0.0, abs=1e-9)
    kept = (excess <= share + 1e-9).any(axis=0)
    fewer = trellis.select(kept)
    np.testing.assert_allclose(fewer.best_paths(fewer.costs).costs, trellis.best_paths(trellis.costs).costs)
    dense = trellis.dense(excess)
    owner, nodes = 0, np.random.default_rng(case.seed).integers(0, trellis.states, network.frames)
    paths = np.tile(nodes, (network.objects, 1))
    more = path_costs(network, paths)[owner] - best_paths(Trellis.of(network)).costs[owner]
    if np.isfinite(more):
        assert dense[owner, np.arange(network.frames - 1), nodes[:-1], nodes[1:]].max() <= more + 1e-9


@many
@given(
    case=cases(objects=3, frames=4, places=3, layouts=(0.0, 0.002)),
    kept=st.floats(0.0, 1.0),
    power=st.sampled_from([1, 2]),
)
def test_a_search_over_some_of_the_arcs_never_makes_an_answer_dearer_or_conflicting(
    case: Case, kept: float, power: int
) -> None:
    if (network := window(case)) is None or not network.layout:
        return
    trellis, rng = SparseTrellis.of(network), np.random.default_rng(case.seed)
    chosen = rng.random(len(trellis)) < kept
    chosen[[step.span.start for step in trellis.steps]] = True
    nodes = greedy_paths(network).nodes
    found = LocalSearch(network, power, arcs=trellis.select(chosen)).improve(nodes)
    assert not conflict_count(network, found)
    assert total_cost(network, found, power) <= total_cost(network, nodes, power) + 1e-9


@many
@given(
    case=cases(objects=3, frames=4, places=3),
    kept=st.floats(0.3, 1.0),
    temperature=st.sampled_from([0.3, 1.0, 10.0]),
)
def test_soft_paths_have_the_shares_of_all_paths_one_by_one(
    case: Case, kept: float, temperature: float
) -> None:
    if (network := window(case)) is None:
        return
    trellis, rng = SparseTrellis.of(network), np.random.default_rng(case.seed)
    trellis = trellis.select((rng.random(len(trellis)) < kept) | (trellis.origin == trellis.target))
    costs = rng.uniform(0.0, 3.0, (network.objects, len(trellis)))
    dense = trellis.dense(costs)
    arcs, nodes = np.zeros_like(dense), np.zeros((network.objects, network.frames, trellis.states))
    steps, frames = np.arange(network.frames - 1), np.arange(network.frames)
    for path in product(range(trellis.states), repeat=network.frames):
        states = np.array(path)
        weight = np.exp(-dense[:, steps, states[:-1], states[1:]].sum(axis=1) / temperature)
        arcs[:, steps, states[:-1], states[1:]] += weight[:, None]
        nodes[:, frames, states] += weight[:, None]
    total = nodes[:, 0].sum(axis=1)[:, None, None]
    found = SoftPaths(trellis).shares(costs.astype(np.float32), temperature)
    np.testing.assert_allclose(found.nodes, nodes / total, atol=1e-3)
    expected = (arcs / total[..., None])[:, trellis.step, trellis.origin, trellis.target]
    np.testing.assert_allclose(found.arcs, expected, atol=1e-3)


@many
@given(case=cases(objects=3, frames=5, places=5), others=st.integers(0, 4), power=st.sampled_from([1, 2]))
def test_running_sums_of_movements_equal_the_differences_one_by_one(
    case: Case, others: int, power: int
) -> None:
    if (network := window(case)) is None:
        return
    trellis = SparseTrellis.of(network)
    rng = np.random.default_rng(case.seed)
    movements = trellis.movements(network.locations)[0]
    # Movements of others on those of arcs, far away from all of them, and in between.
    scale = rng.choice([20.0, 1e4])
    moved = rng.integers(-5, 6, (others, network.frames - 1, 4)) * scale + rng.choice([0.0, 0.3])
    expected = (np.abs(movements[None] - moved[:, trellis.step]) ** power).sum(axis=(0, 2))
    found = MovementChanges(trellis, movements, power).sums(moved)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-6)
