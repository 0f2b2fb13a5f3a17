"""The certificate first: where the prices of the last window still hold, they prove the answer by themselves.

One Viterbi pass at the hinted prices gives a bound. States without conflicts that cost no more than it
are the optimum, and no program need be solved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.network import Network
from tracking.solvers.conflict_finder import ConflictFinder, ConflictRow, priced_rows
from tracking.solvers.hint import Hint
from tracking.solvers.objective import Ints, conflict_count, path_costs
from tracking.solvers.pricing import Pricing
from tracking.solvers.relaxed import CLOSE, Relaxed
from tracking.solvers.viterbi import Paths, best_paths


@dataclass(frozen=True, slots=True, eq=False)
class Recalled:
    """What a hint is worth in a network.

    Attributes:
        rows: the conflict rows of the hint that the network has.
        paths: paths to start from, each of all objects.
        proven: the optimum, if one of them was proven to be it.
    """

    rows: list[ConflictRow]
    paths: list[Paths]
    proven: Relaxed | None


def recall(network: Network, pricing: Pricing, finder: ConflictFinder, hint: Hint) -> Recalled:
    """Try a hint; of a network without layout term."""
    rows, costs = finder.recalled(hint.rows)
    prices = np.array(costs)
    node = with_prices(network, rows, prices)
    priced = pricing.best_paths(node, np.arange(network.objects))
    bound = float(priced.costs.sum() - prices.sum())
    paths = []
    for nodes in (priced.nodes, _as_hinted(network, pricing, node, hint, priced.nodes)):
        true_costs = path_costs(network, nodes)
        paths.append(Paths(nodes, true_costs))
        cost = float(true_costs.sum())
        if cost - bound <= CLOSE * max(1.0, abs(cost)) and not conflict_count(network, nodes):
            usage = np.zeros(network.node.shape)
            np.put_along_axis(usage, nodes[:, :, None], 1.0, axis=2)
            return Recalled(rows, paths, Relaxed(usage, bound, node, 0, priced_rows(network, rows, prices)))
    return Recalled(rows, paths, None)


def with_prices(network: Network, rows: list[ConflictRow], prices: Floats) -> Floats:
    """Give the costs of nodes (n, M, S) with the prices of conflict rows."""
    node = network.node.copy()
    for price, row in zip(prices, rows, strict=True):
        if price > 0.0:
            node[:, row.frame][row.members] += price
    return node


def _as_hinted(network: Network, pricing: Pricing, node: Floats, hint: Hint, nodes: Ints) -> Ints:
    """Give `nodes` (n, M), but for objects that the hint has elsewhere the best paths that follow it."""
    if len(hint.states) != network.objects:
        return nodes
    known = hint.states[:, : network.frames]
    frames = known.shape[1]
    hinted = np.where(known == -1, network.places, known)
    usable = (hinted >= 0) & (hinted <= network.places)
    elsewhere = np.flatnonzero((usable & (hinted != nodes[:, :frames])).any(axis=1))
    if not len(elsewhere):
        return nodes
    bound = node[elsewhere].copy()
    off = np.arange(network.places + 1) != hinted[elsewhere, :, None]
    bound[:, :frames][off & usable[elsewhere, :, None]] = np.inf
    found = best_paths(pricing.trellis.with_node(node).only(elsewhere).with_node(bound))
    # Where the hint asks for arcs that do not exist, it is no help.
    there = np.isfinite(found.costs)
    answer = nodes.copy()
    answer[elsewhere[there]] = found.nodes[there]
    return answer
