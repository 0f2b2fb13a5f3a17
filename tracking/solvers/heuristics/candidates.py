"""Answers without conflicts that need no relaxation: no rounded answer may be dearer than any of them."""

from __future__ import annotations

import numpy as np

from tracking.model.network import Network
from tracking.solvers.heuristics.rounding import round_relaxation
from tracking.solvers.hidden_paths import hidden_nodes
from tracking.solvers.objective import Ints, conflict_count
from tracking.solvers.relaxation import follow_warm_start
from tracking.solvers.viterbi import Paths, Trellis
from tracking.solvers.warm_start import WarmStart


def candidate_nodes(network: Network, alone: Paths, warm_start: WarmStart | None) -> list[Ints]:
    """Return answers (n, M) without conflicts: everybody hidden, the last window's, and of each object alone.

    `alone`: the cheapest path of each object without regard to the others. It is a candidate with all others
    hidden, and with all others on theirs.
    """
    hidden = hidden_nodes(network)
    found = [hidden]
    for owner in range(network.objects):
        nodes = hidden.copy()
        nodes[owner] = alone.nodes[owner]
        found.append(nodes)
    found.append(without_conflicts(network, alone.nodes))
    if warm_start is not None:
        followed = follow_warm_start(network, Trellis.of(network), warm_start, alone.nodes)
        found.append(without_conflicts(network, followed))
    return found


def without_conflicts(network: Network, nodes: Ints) -> Ints:
    """Return nodes (n, M) in which objects are hidden where they conflict with one before them."""
    if not conflict_count(network, nodes):
        return nodes
    usage = np.zeros(network.node.shape)
    np.put_along_axis(usage, nodes[:, :, None], 1.0, axis=2)
    # Shares below 1 are rounded frame by frame instead of taken as integral.
    return round_relaxation(network, 0.5 * usage)
