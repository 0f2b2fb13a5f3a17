"""Better whole states: each object in turn takes its best path around the others."""

from __future__ import annotations

import numpy as np

from tracking.boxes import Floats
from tracking.conflicts import Bools
from tracking.network import Network
from tracking.solvers.objective import Ints, block, locations_at, objective
from tracking.solvers.viterbi import Trellis, best_paths

_ROUNDS = 20
"""Far above what it takes to settle; bounds the time whatever the window."""


def improved(network: Network, nodes: Ints, power: int = 1) -> Ints:
    """Give nodes (n, M) without conflicts that cost no more, from nodes without conflicts.

    Repairs what the rounding of II.D may leave, since it looks at each frame by itself: arcs that do not
    exist where arcs are gated, and jumps where the relaxation was split. `power` is that of the layout
    term.
    """
    best, cost = nodes.copy(), objective(network, nodes, power)
    exclusions = network.exclusions()
    for _ in range(_ROUNDS):
        before = cost
        for owner in range(network.objects):
            trial = best.copy()
            trial[owner] = _rerouted(network, exclusions, best, owner, power)
            tried = objective(network, trial, power)
            if tried < cost or not np.isfinite(cost):
                best, cost = trial, tried
        if not cost < before - 1e-12 * max(1.0, abs(cost)):
            break
    return best


def _rerouted(network: Network, exclusions: Bools, nodes: Ints, owner: int, power: int) -> Ints:
    """Give the best path of one object while the others stay where they are."""
    node = network.node.copy()
    for other in range(network.objects):
        if other != owner:
            block(network, exclusions, node, (other, nodes[other]))
    own = np.array([owner])
    pair = network.pair[network.sets[own]]
    if network.layout:
        pair = pair + network.layout * _layout_of_arcs(network, nodes, owner, power)
    trellis = Trellis(network.source[own], node[own], pair, network.sink[own])
    return np.asarray(best_paths(trellis).nodes[0])


def _layout_of_arcs(network: Network, nodes: Ints, owner: int, power: int) -> Floats:
    """Give what each arc of one object adds to the layout term without μ, (1, M - 1, S, S)."""
    where = network.locations[network.sets[owner]]
    moves = where[1:, None, :, :] - where[:-1, :, None, :]
    others = np.diff(np.delete(locations_at(network, nodes), owner, axis=0), axis=1)
    apart = np.zeros(moves.shape[:3])
    for other in others:
        apart += (np.abs(moves - other[:, None, None, :]) ** power).sum(axis=3)
    return apart[None]
