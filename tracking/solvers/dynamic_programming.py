"""Baselines by dynamic programming: `separate-dp` (paper IV.A.3, Fig. 16) and `greedy-dp`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracking.model.network import Network
from tracking.solvers.base import Solution, SolveReport, TimedSolver
from tracking.solvers.budget import BudgetMeter
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
    """The cheapest path of each object; conflicts and layout are ignored. A baseline and a lower bound."""

    name = "separate-dp"

    def _solve(self, network: Network, _warm_start: WarmStart | None, _meter: BudgetMeter) -> Solution:
        """Return the cheapest paths; the sum of their costs is the bound."""
        paths = best_paths(Trellis.of(network))
        conflicts = conflict_count(network, paths.nodes)
        cost = total_cost(network, paths.nodes)
        bound = float(paths.costs.sum())
        report = SolveReport(
            solver=self.name,
            objective=cost,
            bound=bound,
            integral=False,
            conflicts=conflicts,
            rounds=1,
        )
        return Solution(states_from_nodes(network, paths.nodes), report)


@dataclass(frozen=True, slots=True, eq=False)
class GreedyPaths:
    """Greedy paths, (n, M) nodes, and the bound that the first pass proves."""

    nodes: Ints
    bound: float


def greedy_paths(network: Network, alone: Paths | None = None) -> GreedyPaths:
    """Fix the cheapest path, block its places for the other objects, and repeat; the layout term is ignored.

    Of equal paths the one of the lowest object is fixed first. `alone`: the cheapest path of each object, if
    known. An object that cannot be occluded in a frame and has no free place there stays in conflict.
    """
    exclusions = network.exclusions()
    trellis = Trellis.of(network).with_node(network.node.copy())
    each, frames = np.indices((network.objects, network.frames))
    alone = best_paths(trellis) if alone is None else alone
    nodes, costs, bound = alone.nodes.copy(), alone.costs.copy(), float(alone.costs.sum())
    open_objects = np.ones(network.objects, dtype=np.bool_)
    while open_objects.any():
        candidates = np.flatnonzero(open_objects)
        owner = int(candidates[costs[candidates].argmin()])
        open_objects[owner] = False
        block_conflicting_nodes(network, exclusions, trellis.node, (owner, nodes[owner]))
        # A cheapest path without a blocked node is still the cheapest.
        blocked = np.flatnonzero(open_objects & np.isinf(trellis.node[each, frames, nodes]).any(axis=1))
        if len(blocked):
            rerouted = best_paths(trellis.select(blocked))
            nodes[blocked], costs[blocked] = rerouted.nodes, rerouted.costs
    return GreedyPaths(nodes, bound)


class GreedyDpSolver(TimedSolver):
    """Greedy assignment, cheapest path first: fast and without conflicts, but not optimal. A baseline."""

    name = "greedy-dp"

    def _solve(self, network: Network, _warm_start: WarmStart | None, _meter: BudgetMeter) -> Solution:
        """Return the greedy paths; the bound is the cost of all cheapest paths, conflicts ignored."""
        paths = greedy_paths(network)
        cost, conflicts = total_cost(network, paths.nodes), conflict_count(network, paths.nodes)
        report = SolveReport(
            solver=self.name,
            objective=cost,
            bound=paths.bound,
            integral=False,
            conflicts=conflicts,
            rounds=network.objects,
        )
        return Solution(states_from_nodes(network, paths.nodes), report)
