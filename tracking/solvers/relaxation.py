"""The optimum of the relaxation, and its shortcut by a warm start."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tracking.boxes import Floats
from tracking.model.network import Network
from tracking.solvers.budget import Limit
from tracking.solvers.cutting_planes import ConflictRow, ConflictSeparator, RowMembers, conflict_prices
from tracking.solvers.heuristics.rounding import is_integral
from tracking.solvers.objective import Ints, conflict_count, path_costs
from tracking.solvers.sparse_trellis import SparseTrellis
from tracking.solvers.viterbi import PathPricer, Paths, Trellis, best_paths
from tracking.solvers.warm_start import ConflictPrice, WarmStart

OPTIMALITY_TOLERANCE = 1e-11
"""Relative distance of cost and bound at which the optimum is proven; far below the documented 1e-9."""

CLOSE_GAP = 2e-3
"""Relative distance of an answer and a bound at which no better ones are searched, with a layout term."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownAnswer:
    """An answer that a search for the optimum came across.

    Attributes:
        nodes: (n, M) its nodes, without conflicts.
        near_arcs: the arcs that cheaper answers are likely on: those of the cheapest paths at the prices.
    """

    nodes: Ints
    near_arcs: SparseTrellis


@dataclass(frozen=True, slots=True, eq=False)
class RelaxedSolution:
    """The optimum of the relaxation.

    Attributes:
        usage: y (n, M, S), the flow of each object through each node.
        bound: its cost, as proven by the prices.
        priced: the trellis with the prices of conflicts and of the layout, whose cheapest paths prove the
            bound.
        rounds: how often paths or arcs were priced.
        prices: the binding conflict rows, if all objects share the observations.
        bound_reductions: (M,) by how much the prices of each frame's rows reduce the bound; empty without
            layout term.
        limit: the limit at which the search ended before the optimum, None if it is the optimum. Then y may
            violate rows, and the bound is lower.
        is_optimum: False: it is not the optimum of a relaxation, but near that of one, as an ascent finds it.
        answer: the cheapest answer that the search came across, if any.
    """

    usage: Floats
    bound: float
    priced: Trellis
    rounds: int
    prices: tuple[ConflictPrice, ...] = ()
    bound_reductions: Floats = field(default_factory=lambda: np.empty(0))
    limit: Limit | None = None
    is_optimum: bool = True
    answer: KnownAnswer | None = None

    @property
    def is_integral(self) -> bool:
        """Whether it is the optimum of the relaxation, and all of its y are 0 or 1."""
        return self.is_optimum and self.limit is None and is_integral(self.usage)


@dataclass(frozen=True, slots=True, eq=False)
class WarmStartResult:
    """Result of a warm start in a network.

    Attributes:
        rows: the conflict rows of the warm start that the network has.
        paths: paths of all objects to start from.
        proven: the optimum, if one of the paths was proven optimal.
    """

    rows: list[ConflictRow]
    paths: list[Paths]
    proven: RelaxedSolution | None


def try_warm_start(
    network: Network, pricing: PathPricer, finder: ConflictSeparator, warm_start: WarmStart
) -> WarmStartResult:
    """Evaluate a warm start in a network without layout term."""
    rows, costs = finder.match_prices(warm_start.rows)
    prices = np.array(costs)
    node = add_conflict_prices(network, rows, prices)
    priced = pricing.best_paths(node, np.arange(network.objects))
    bound = float(priced.costs.sum() - prices.sum())
    paths = []
    trellis = pricing.trellis.with_node(node)
    for nodes in (priced.nodes, follow_warm_start(network, trellis, warm_start, priced.nodes)):
        true_costs = path_costs(network, nodes)
        paths.append(Paths(nodes, true_costs))
        cost = float(true_costs.sum())
        if cost - bound <= OPTIMALITY_TOLERANCE * max(1.0, abs(cost)) and not conflict_count(network, nodes):
            usage = np.zeros(network.node.shape)
            np.put_along_axis(usage, nodes[:, :, None], 1.0, axis=2)
            return WarmStartResult(
                rows, paths, RelaxedSolution(usage, bound, trellis, 0, conflict_prices(network, rows, prices))
            )
    return WarmStartResult(rows, paths, None)


def add_conflict_prices(network: Network, rows: list[ConflictRow], prices: Floats) -> Floats:
    """Return node costs (n, M, S) with the prices of conflict rows."""
    members = RowMembers(network)
    members.add(rows)
    return members.add_prices(network.node, prices)


def follow_warm_start(network: Network, trellis: Trellis, warm_start: WarmStart, nodes: Ints) -> Ints:
    """Return `nodes` (n, M), replaced by the best paths that follow the warm start where it differs.

    `trellis` has the costs of the paths, with or without prices.
    """
    if len(warm_start.states) != network.objects:
        return nodes
    known = warm_start.states[:, : network.frames]
    frames = known.shape[1]
    hinted = np.where(known == -1, network.max_places, known)
    usable = (hinted >= 0) & (hinted <= network.max_places)
    differing = np.flatnonzero((usable & (hinted != nodes[:, :frames])).any(axis=1))
    if not len(differing):
        return nodes
    restricted = trellis.node[differing].copy()
    off = np.arange(network.max_places + 1) != hinted[differing, :, None]
    restricted[:, :frames][off & usable[differing, :, None]] = np.inf
    found = best_paths(trellis.select(differing).with_node(restricted))
    # Ignore the warm start where it requires missing arcs.
    feasible = np.isfinite(found.costs)
    followed = nodes.copy()
    followed[differing[feasible]] = found.nodes[feasible]
    return followed
