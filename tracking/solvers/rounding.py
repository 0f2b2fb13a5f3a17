"""From the relaxation to whole states: the rounding of paper II.D."""

from __future__ import annotations

import numpy as np

from tracking.boxes import Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.objective import Ints, locations_at, path_cost, total_cost
from tracking.solvers.viterbi import MinMarginals, PrunedStates, Trellis, best_paths, trace_back

_ZERO_TOLERANCE = 1e-9
"""A node with less than this on it is not on any path."""

INTEGRALITY_TOLERANCE = 1e-6
"""Nodes within this of 0 or 1 are whole: well above the solver's feasibility tolerance."""


def is_integral(usage: Floats) -> bool:
    """Return whether all of y are 0 or 1."""
    return bool((np.minimum(usage, 1.0 - usage) <= INTEGRALITY_TOLERANCE).all())


def round_relaxation(network: Network, usage: Floats) -> Ints:
    """Round y = `usage` (n, M, S) to nodes (n, M) without conflicts.

    In each frame the largest y becomes 1, its conflicting nodes and the other nodes of its object 0;
    then the next largest. Of equal ones the lowest object and state come first. An object that keeps
    nothing is occluded.
    """
    exclusions = network.exclusions()
    nodes = np.full((network.objects, network.frames), network.places, dtype=np.int64)
    whole = usage.max(axis=2, initial=0.0) >= 1.0 - INTEGRALITY_TOLERANCE
    for m in range(network.frames):
        if whole[:, m].all():
            nodes[:, m] = usage[:, m].argmax(axis=1)
        else:
            nodes[:, m] = _round_frame(network, usage[:, m].copy(), exclusions[m])
    return nodes


def _round_frame(network: Network, usage: Floats, exclusions: Bools) -> Ints:
    places, sets = network.places, network.sets
    nodes = np.full(network.objects, places, dtype=np.int64)
    for _ in range(network.objects):
        owner, state = divmod(int(usage.argmax()), places + 1)
        if usage[owner, state] <= _ZERO_TOLERANCE:
            break
        nodes[owner] = state
        if state < places:
            barred = exclusions[sets[owner] * places + state].reshape(-1, places)
            usage[:, :places][np.broadcast_to(barred, (len(usage), places))] = 0.0
        usage[owner] = 0.0
    return nodes


_MAX_ROUNDS = 20
"""Far above what it takes to settle; bounds the time whatever the window."""

_MIN_IMPROVEMENT = 1e-12
"""Relative: what is cheaper by less is no cheaper."""


class LocalSearch:
    """Improves states of one network; `power` is that of its layout term.

    Attributes:
        alone: the cheapest path of each object, the others ignored.
    """

    def __init__(self, network: Network, power: int = 1) -> None:
        self._network = network
        self._power = power
        self._trellis = Trellis.of(network)
        self._passes = MinMarginals.of(self._trellis)
        self.alone = trace_back(self._trellis, self._passes.forward)

    def improve(self, nodes: Ints) -> Ints:
        """Return nodes (n, M) without conflicts that cost no more, from nodes without conflicts.

        Repairs what the rounding of II.D may leave, since it looks at each frame by itself: arcs that do
        not exist where arcs are gated, and jumps where the relaxation was split.
        """
        turns = _CoordinateDescent(self._network, self._trellis, self._passes, self._power)
        turns.nodes = nodes.copy()
        cost = total_cost(self._network, nodes, self._power)
        for _ in range(_MAX_ROUNDS):
            changed = [turns.reroute(owner) for owner in range(self._network.objects)]
            before, cost = cost, total_cost(self._network, turns.nodes, self._power)
            if not any(changed) or not cost < before - _MIN_IMPROVEMENT * max(1.0, abs(cost)):
                break
        return turns.nodes


class _CoordinateDescent:
    """Lets one object after the other choose; an object whose others have not moved has nothing to do."""

    def __init__(self, network: Network, trellis: Trellis, passes: MinMarginals, power: int) -> None:
        self._network = network
        self._power = power
        self._exclusions = network.exclusions()
        self._trellis = trellis
        self._through, self._least = passes.through, passes.least
        self._settled = np.zeros(network.objects, dtype=np.bool_)
        self.nodes = np.empty((network.objects, network.frames), dtype=np.int64)

    def reroute(self, owner: int) -> bool:
        """Move one object to its best path around the others; return whether it moved."""
        if self._settled[owner]:
            return False
        cost = self._own_cost(owner)
        if np.isfinite(cost) and cost <= self._least[owner] + _MIN_IMPROVEMENT * max(1.0, abs(cost)):
            return False
        before = self.nodes[owner].copy()
        self.nodes[owner] = self._rerouted(owner, cost)
        moved = self._own_cost(owner) < cost
        if moved:
            self._settled[:] = False
        else:
            self.nodes[owner] = before
        self._settled[owner] = True
        return moved

    def _own_cost(self, owner: int) -> float:
        """Return the part of the objective that depends on one object's path."""
        network = self._network
        cost = path_cost(network, self.nodes[owner], owner)
        if network.layout:
            moves = np.diff(locations_at(network, self.nodes), axis=1)
            cost += network.layout * float((np.abs(moves - moves[owner]) ** self._power).sum())
        return cost

    def _rerouted(self, owner: int, cost: float) -> Ints:
        """Return the best path of one object while the others stay where they are; it has one at `cost`.

        The layout term takes nothing off a path, so states through which every path costs more than that
        can be left out before it is computed.
        """
        network = self._network
        node = network.node[owner].copy()
        node[:, :-1][self._barred(owner)] = np.inf
        limit = cost + _MIN_IMPROVEMENT * max(1.0, abs(cost)) if np.isfinite(cost) else np.inf
        packed = PrunedStates.of(((self._through[owner] <= limit) & np.isfinite(node))[None])
        trellis = packed.trellis(self._trellis.select(np.array([owner])).with_node(node[None]))
        if network.layout:
            trellis.pair[0] += network.layout * self._layout_of_arcs(owner, packed)
        return np.asarray(packed.original_states(best_paths(trellis).nodes)[0])

    def _barred(self, owner: int) -> Bools:
        """Return which places of one object the others bar, (M, K)."""
        network = self._network
        places, sets = network.places, network.sets
        others = np.delete(np.arange(network.objects), owner)
        taken = self.nodes[others]
        visible = taken < places
        at = np.where(visible, sets[others, None] * places + taken, 0)
        own = slice(sets[owner] * places, (sets[owner] + 1) * places)
        if not self._exclusions.size:
            return np.zeros((network.frames, places), dtype=np.bool_)
        barred = self._exclusions[np.arange(network.frames), at, own] & visible[:, :, None]
        return np.asarray(barred.any(axis=0))

    def _layout_of_arcs(self, owner: int, packed: PrunedStates) -> Floats:
        """Return what each arc between states kept adds to the layout term without μ, (M - 1, W, W)."""
        network = self._network
        where = packed.states(network.locations[network.sets[[owner]]], 0.0)[0]
        others = np.diff(np.delete(locations_at(network, self.nodes), owner, axis=0), axis=1)
        apart = np.zeros((network.frames - 1, where.shape[1], where.shape[1]))
        for side in range(where.shape[2]):
            moves = where[1:, None, :, side] - where[:-1, :, None, side]
            for other in others[:, :, side]:
                apart += np.abs(moves - other[:, None, None]) ** self._power
        return apart
