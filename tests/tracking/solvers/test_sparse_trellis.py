"""Arcs in lists: the same passes and paths as over all pairs of states."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.tracking.random_networks import Case, cases, network_of
from tracking.model.network import Network
from tracking.solvers.heuristics.local_search import MovementChanges
from tracking.solvers.hidden_paths import allow_hiding
from tracking.solvers.objective import path_costs
from tracking.solvers.sparse_trellis import SparseTrellis
from tracking.solvers.viterbi import MinMarginals, Trellis, best_paths

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
