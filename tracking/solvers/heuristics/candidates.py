"""Answers without conflicts that need no relaxation: no rounded answer may be dearer than any of them."""

from __future__ import annotations

import numpy as np

from tracking.model.network import Network
from tracking.solvers.hidden_paths import hidden_nodes
from tracking.solvers.objective import Ints
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
    exclusions = network.exclusions()
    if not exclusions.size:
        return nodes
    frames, places = np.arange(network.frames), network.max_places
    visible = nodes < places
    index = np.where(visible, network.sets[:, None] * places + nodes, 0)
    for owner in range(1, network.objects):
        excluded = exclusions[frames, index[:owner], index[owner]] & visible[:owner]
        visible[owner] &= ~excluded.any(axis=0)
    return np.where(visible, nodes, places)
