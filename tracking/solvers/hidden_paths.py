"""Networks in which an object may not be hidden in some frames, made solvable by the same searches.

Column generation and rounding start from the path on which an object is hidden throughout. Where a network
excludes it, it gets a cost far above every other path, so that only a network without an answer uses it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.model.network import Network
from tracking.solvers.objective import Ints, path_costs

_MARGIN = 10.0
"""The cost of such a path relative to a bound of all others together."""


def hidden_nodes(network: Network) -> Ints:
    """Return the nodes (n, M) of objects that are hidden throughout."""
    return np.full((network.objects, network.frames), network.max_places, dtype=np.int64)


def allow_hiding(network: Network) -> Network:
    """Return a network in which every object has the path that is hidden throughout.

    It is the same network if every object has it already. Its optimum is a lower bound of the network's.
    """
    missing = np.flatnonzero(~np.isfinite(path_costs(network, hidden_nodes(network))))
    if not len(missing):
        return network
    penalty = _MARGIN * (1.0 + _total_of_dearest(network))
    source, node, sink = network.source.copy(), network.node.copy(), network.sink.copy()
    pair = network.pair.copy()
    source[missing, -1] = _finite(source[missing, -1], penalty)
    sink[missing, -1] = _finite(sink[missing, -1], penalty)
    node[missing, :, -1] = _finite(node[missing, :, -1], penalty)
    sets = np.unique(network.pair_sets[missing])
    pair[sets, :, -1, -1] = _finite(pair[sets, :, -1, -1], penalty)
    return replace(network, source=source, node=node, pair=pair, sink=sink)


def _finite(costs: Floats, penalty: float) -> Floats:
    return np.where(np.isinf(costs), penalty, costs)


def _total_of_dearest(network: Network) -> float:
    """Return a bound of the cost of all objects together on finite arcs, the layout term included."""

    def dearest(costs: Floats) -> float:
        return float(np.abs(costs[np.isfinite(costs)]).max(initial=0.0))

    steps = network.objects * network.frames
    total = steps * (dearest(network.node) + dearest(network.pair))
    total += network.objects * (dearest(network.source) + dearest(network.sink))
    if network.layout:
        reach = float(np.ptp(network.locations.reshape(-1, BOX_SIDES), axis=0).sum())
        total += network.layout * steps * network.objects * 2.0 * reach
    return total
