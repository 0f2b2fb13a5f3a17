"""The optimum of the relaxation, however it was found."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tracking.boxes import Floats
from tracking.model.network import Network
from tracking.solvers.cutting_planes import ConflictRow, ConflictSeparator, conflict_prices
from tracking.solvers.objective import Ints, conflict_count, path_costs
from tracking.solvers.viterbi import PathPricer, Paths, best_paths
from tracking.solvers.warm_start import ConflictPrice, WarmStart

OPTIMALITY_TOLERANCE = 1e-11
"""Relative distance of cost and bound at which the optimum is proven; far below the 1e-9 promised."""


@dataclass(frozen=True, slots=True, eq=False)
class RelaxedSolution:
    """The optimum of the relaxation.

    Attributes:
        usage: y (n, M, S), how much of each object goes through each node.
        bound: its cost, as the prices prove it.
        priced: (n, M, S) the costs of nodes with the prices of conflicts and of the layout on them, at
            which the cheapest paths prove the bound.
        rounds: how often paths or arcs were priced.
        prices: the conflict rows that bind, where all objects share them.
        layout_prices: (n, M - 1, 4) what moves earn by the layout term; none without.
        charges: (M,) what the prices of a frame's rows take off the bound; none without layout term.
    """

    usage: Floats
    bound: float
    priced: Floats
    rounds: int
    prices: tuple[ConflictPrice, ...] = ()
    layout_prices: Floats = field(default_factory=lambda: np.empty(0))
    charges: Floats = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True, slots=True, eq=False)
class WarmStartResult:
    """What a warm_start is worth in a network.

    Attributes:
        rows: the conflict rows of the hint that the network has.
        paths: paths to start from, each of all objects.
        proven: the optimum, if one of them was proven to be it.
    """

    rows: list[ConflictRow]
    paths: list[Paths]
    proven: RelaxedSolution | None


def try_warm_start(
    network: Network, pricing: PathPricer, finder: ConflictSeparator, warm_start: WarmStart
) -> WarmStartResult:
    """Try a hint; of a network without layout term."""
    rows, costs = finder.match_prices(warm_start.rows)
    prices = np.array(costs)
    node = add_conflict_prices(network, rows, prices)
    priced = pricing.best_paths(node, np.arange(network.objects))
    bound = float(priced.costs.sum() - prices.sum())
    paths = []
    for nodes in (priced.nodes, _follow_warm_start(network, pricing, node, warm_start, priced.nodes)):
        true_costs = path_costs(network, nodes)
        paths.append(Paths(nodes, true_costs))
        cost = float(true_costs.sum())
        if cost - bound <= OPTIMALITY_TOLERANCE * max(1.0, abs(cost)) and not conflict_count(network, nodes):
            usage = np.zeros(network.node.shape)
            np.put_along_axis(usage, nodes[:, :, None], 1.0, axis=2)
            return WarmStartResult(
                rows, paths, RelaxedSolution(usage, bound, node, 0, conflict_prices(network, rows, prices))
            )
    return WarmStartResult(rows, paths, None)


def add_conflict_prices(network: Network, rows: list[ConflictRow], prices: Floats) -> Floats:
    """Return the costs of nodes (n, M, S) with the prices of conflict rows."""
    node = network.node.copy()
    for price, row in zip(prices, rows, strict=True):
        if price > 0.0:
            node[:, row.frame][row.members] += price
    return node


def _follow_warm_start(
    network: Network, pricing: PathPricer, node: Floats, warm_start: WarmStart, nodes: Ints
) -> Ints:
    """Return `nodes` (n, M), but for objects that the hint has elsewhere the best paths that follow it."""
    if len(warm_start.states) != network.objects:
        return nodes
    known = warm_start.states[:, : network.frames]
    frames = known.shape[1]
    hinted = np.where(known == -1, network.places, known)
    usable = (hinted >= 0) & (hinted <= network.places)
    elsewhere = np.flatnonzero((usable & (hinted != nodes[:, :frames])).any(axis=1))
    if not len(elsewhere):
        return nodes
    bound = node[elsewhere].copy()
    off = np.arange(network.places + 1) != hinted[elsewhere, :, None]
    bound[:, :frames][off & usable[elsewhere, :, None]] = np.inf
    found = best_paths(pricing.trellis.with_node(node).select(elsewhere).with_node(bound))
    # Where the hint asks for arcs that do not exist, it is no help.
    there = np.isfinite(found.costs)
    answer = nodes.copy()
    answer[elsewhere[there]] = found.nodes[there]
    return answer
