"""`separate-dp`: every object on its own, conflicts and layout ignored (paper IV.A.3, Fig. 16)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tracking.model.network import Network
from tracking.solvers.base import Solution, SolveReport, TimedSolver
from tracking.solvers.objective import (
    Ints,
    block_conflicting_nodes,
    conflict_count,
    states_from_nodes,
    total_cost,
)
from tracking.solvers.viterbi import Paths, Trellis, best_paths
from tracking.solvers.warm_start import WarmStart


class SeparateDpSolver(TimedSolver):
    """The cheapest path of each object; two objects may take one place. A baseline, and a bound."""

    name = "separate-dp"

    def _solve(self, network: Network, _warm_start: WarmStart | None) -> Solution:
        """Return the cheapest paths; the sum of their costs is the bound."""
        paths = best_paths(Trellis.of(network))
        conflicts = conflict_count(network, paths.nodes)
        cost = total_cost(network, paths.nodes)
        bound = float(paths.costs.sum())
        report = SolveReport(
            solver=self.name,
            objective=cost,
            bound=bound,
            integral=conflicts == 0 and not network.layout,
            conflicts=conflicts,
            rounds=1,
        )
        return Solution(states_from_nodes(network, paths.nodes), report)


@dataclass(frozen=True, slots=True, eq=False)
class GreedyPaths:
    """The paths of best track first, (n, M) nodes, and the bound that the first pass proves."""

    nodes: Ints
    bound: float


def greedy_paths(network: Network, alone: Paths | None = None) -> GreedyPaths:
    """Fix the cheapest path, bar its places to the others, and go on; the layout term is ignored.

    Of equal paths the one of the lowest object is fixed first. `alone`, where known, are the cheapest
    paths of all. An object that may not be occluded somewhere, and to which nothing is left there, is in
    conflict.
    """
    exclusions = network.exclusions()
    trellis = Trellis(network.source, network.node.copy(), network.pair, network.sink)
    each, frames = np.indices((network.objects, network.frames))
    alone = best_paths(trellis) if alone is None else alone
    nodes, costs, bound = alone.nodes.copy(), alone.costs.copy(), float(alone.costs.sum())
    left = np.ones(network.objects, dtype=np.bool_)
    while left.any():
        rest = np.flatnonzero(left)
        owner = int(rest[costs[rest].argmin()])
        left[owner] = False
        block_conflicting_nodes(network, exclusions, trellis.node, (owner, nodes[owner]))
        # A cheapest path of which nothing is barred is still the cheapest.
        cut = np.flatnonzero(left & np.isinf(trellis.node[each, frames, nodes]).any(axis=1))
        if len(cut):
            again = best_paths(trellis.select(cut))
            nodes[cut], costs[cut] = again.nodes, again.costs
    return GreedyPaths(nodes, bound)


class GreedyDpSolver(TimedSolver):
    """Best track first: quick, never in conflict, not always right. A baseline."""

    name = "greedy-dp"

    def _solve(self, network: Network, _warm_start: WarmStart | None) -> Solution:
        """Return the greedy paths; the bound is the cost of all cheapest paths, conflicts ignored."""
        paths = greedy_paths(network)
        cost, conflicts = total_cost(network, paths.nodes), conflict_count(network, paths.nodes)
        attained = math.isfinite(cost) and cost - paths.bound <= 1e-9 * max(1.0, abs(cost))
        report = SolveReport(
            solver=self.name,
            objective=cost,
            bound=paths.bound,
            integral=not conflicts and attained,
            conflicts=conflicts,
            rounds=network.objects,
        )
        return Solution(states_from_nodes(network, paths.nodes), report)
