"""`greedy-dp`: best track first (paper I.A and IV.A.3, Figs. 10 and 17)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracking.network import Network
from tracking.solvers.base import Solution, SolveReport
from tracking.solvers.objective import Ints, block, objective, states_of
from tracking.solvers.viterbi import Trellis, best_paths


@dataclass(frozen=True, slots=True, eq=False)
class GreedyPaths:
    """The paths of best track first, (n, M) nodes, and the bound that the first pass proves."""

    nodes: Ints
    bound: float


def greedy_paths(network: Network) -> GreedyPaths:
    """Fix the cheapest path, bar its places to the others, and go on; the layout term is ignored.

    Of equal paths the one of the lowest object is fixed first.
    """
    exclusions = network.exclusions()
    trellis = Trellis(network.source, network.node.copy(), network.pair, network.sink)
    nodes = np.empty((network.objects, network.frames), dtype=np.int64)
    left = np.arange(network.objects)
    bound = 0.0
    while len(left):
        paths = best_paths(trellis.only(left))
        if len(left) == network.objects:
            bound = float(paths.costs.sum())
        first = int(paths.costs.argmin())
        owner = int(left[first])
        nodes[owner] = paths.nodes[first]
        block(network, exclusions, trellis.node, (owner, nodes[owner]))
        left = np.delete(left, first)
    return GreedyPaths(nodes, bound)


class GreedyDp:
    """Best track first: quick, never in conflict, not always right. A baseline."""

    name = "greedy-dp"

    def solve(self, network: Network) -> Solution:
        """Give the greedy paths; the bound is the cost of all cheapest paths, conflicts ignored."""
        paths = greedy_paths(network)
        cost = objective(network, paths.nodes)
        report = SolveReport(
            solver=self.name,
            objective=cost,
            bound=paths.bound,
            integral=cost - paths.bound <= 1e-9 * max(1.0, abs(cost)),
            conflicts=0,
            rounds=network.objects,
        )
        return Solution(states_of(network, paths.nodes), report)
