"""Rounding of the relaxation to integer states (paper II.D), and local search."""

from __future__ import annotations

import numpy as np

from tracking.boxes import Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.budget import BudgetMeter
from tracking.solvers.objective import Ints, locations_at, path_cost, total_cost
from tracking.solvers.viterbi import MinMarginals, PrunedStates, Trellis, best_paths, trace_back

_ZERO_TOLERANCE = 1e-9
"""Flow below which a node is on no path."""

INTEGRALITY_TOLERANCE = 1e-6
"""Distance from 0 or 1 up to which y is integral: well above the solver's feasibility tolerance."""


def is_integral(usage: Floats) -> bool:
    """Return whether all of y are 0 or 1."""
    return bool((np.minimum(usage, 1.0 - usage) <= INTEGRALITY_TOLERANCE).all())


def round_relaxation(network: Network, usage: Floats) -> Ints:
    """Round y = `usage` (n, M, S) to nodes (n, M) without conflicts.

    In each frame the largest y becomes 1, its conflicting nodes and the other nodes of its object 0;
    then the next largest. Ties go to the lowest object and state. An object without a node is
    occluded.
    """
    exclusions = network.exclusions()
    nodes = np.full((network.objects, network.frames), network.max_places, dtype=np.int64)
    integral = usage.max(axis=2, initial=0.0) >= 1.0 - INTEGRALITY_TOLERANCE
    for m in range(network.frames):
        if integral[:, m].all():
            nodes[:, m] = usage[:, m].argmax(axis=1)
        else:
            nodes[:, m] = _round_frame(network, usage[:, m].copy(), exclusions[m])
    return nodes


def _round_frame(network: Network, usage: Floats, exclusions: Bools) -> Ints:
    places, sets = network.max_places, network.sets
    nodes = np.full(network.objects, places, dtype=np.int64)
    for _ in range(network.objects):
        owner, state = divmod(int(usage.argmax()), places + 1)
        if usage[owner, state] <= _ZERO_TOLERANCE:
            break
        nodes[owner] = state
        if state < places:
            excluded = exclusions[sets[owner] * places + state].reshape(-1, places)
            usage[:, :places][np.broadcast_to(excluded, (len(usage), places))] = 0.0
        usage[owner] = 0.0
    return nodes


_MAX_ROUNDS = 20
"""Limit of the rounds, far above what convergence takes."""

_MIN_IMPROVEMENT = 1e-12
"""Relative improvement below which costs count as equal."""


class LocalSearch:
    """Coordinate descent over the objects of one network; `power` is that of its layout term.

    Attributes:
        alone: the cheapest path of each object without regard to the others.
    """

    def __init__(self, network: Network, power: int = 1, meter: BudgetMeter | None = None) -> None:
        self._network = network
        self._power = power
        self._meter = meter or BudgetMeter()
        self._meter.add_passes(*network.node.shape)
        self._meter.add_passes(*network.node.shape)
        self._trellis = Trellis.of(network)
        self._passes = MinMarginals.of(self._trellis)
        self.alone = trace_back(self._trellis, self._passes.forward)

    def improve(self, nodes: Ints) -> Ints:
        """Return nodes (n, M) without conflicts that cost no more, from nodes without conflicts.

        They are the same nodes if the meter's budget is spent.
        Repairs the effects of rounding each frame separately (II.D): missing arcs if arcs are gated, and
        jumps where the relaxation was fractional.
        """
        descent = _CoordinateDescent(self._network, self._trellis, self._passes, self._power, self._meter)
        descent.nodes = nodes.copy()
        cost = total_cost(self._network, nodes, self._power)
        for _ in range(_MAX_ROUNDS):
            changed = [descent.reroute(owner) for owner in range(self._network.objects)]
            before, cost = cost, total_cost(self._network, descent.nodes, self._power)
            if not any(changed) or not cost < before - _MIN_IMPROVEMENT * max(1.0, abs(cost)):
                break
        return descent.nodes


class _CoordinateDescent:
    """Reroutes one object after another; an object is skipped if no other has moved since its last turn."""

    def __init__(
        self, network: Network, trellis: Trellis, passes: MinMarginals, power: int, meter: BudgetMeter
    ) -> None:
        self._network = network
        self._meter = meter
        self._power = power
        self._exclusions = network.exclusions()
        self._trellis = trellis
        self._through, self._least = passes.through, passes.least
        self._settled = np.zeros(network.objects, dtype=np.bool_)
        self.nodes = np.empty((network.objects, network.frames), dtype=np.int64)

    def reroute(self, owner: int) -> bool:
        """Move one object to its best path around the others; return whether it moved."""
        if self._settled[owner] or self._meter.reached():
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
        """Return the best path of one object with the others fixed; its current path costs `cost`.

        The layout term is not negative, so states whose best path already costs more are left out.
        """
        network = self._network
        node = network.node[owner].copy()
        node[:, :-1][self._excluded(owner)] = np.inf
        limit = cost + _MIN_IMPROVEMENT * max(1.0, abs(cost)) if np.isfinite(cost) else np.inf
        packed = PrunedStates.of(((self._through[owner] <= limit) & np.isfinite(node))[None])
        states = packed.index.shape[2]
        self._meter.add_step()
        self._meter.add_passes(1, network.frames, states)
        trellis = packed.trellis(self._trellis.select(np.array([owner])).with_node(node[None]))
        if network.layout:
            self._meter.add_layout(network.objects - 1, network.frames, states)
            trellis.pair[0] += network.layout * self._layout_of_arcs(owner, packed)
        return np.asarray(packed.original_states(best_paths(trellis).nodes)[0])

    def _excluded(self, owner: int) -> Bools:
        """Return the places of one object that the others exclude, (M, K)."""
        network = self._network
        places, sets = network.max_places, network.sets
        others = np.delete(np.arange(network.objects), owner)
        occupied = self.nodes[others]
        visible = occupied < places
        index = np.where(visible, sets[others, None] * places + occupied, 0)
        own = slice(sets[owner] * places, (sets[owner] + 1) * places)
        if not self._exclusions.size:
            return np.zeros((network.frames, places), dtype=np.bool_)
        excluded = self._exclusions[np.arange(network.frames), index, own] & visible[:, :, None]
        return np.asarray(excluded.any(axis=0))

    def _layout_of_arcs(self, owner: int, packed: PrunedStates) -> Floats:
        """Return the layout term, without μ, of each arc between the kept states, (M - 1, W, W)."""
        network = self._network
        locations = packed.states(network.locations[network.sets[[owner]]], 0.0)[0]
        others = np.diff(np.delete(locations_at(network, self.nodes), owner, axis=0), axis=1)
        changes = np.zeros((network.frames - 1, locations.shape[1], locations.shape[1]))
        for side in range(locations.shape[2]):
            moves = locations[1:, None, :, side] - locations[:-1, :, None, side]
            for other in others[:, :, side]:
                changes += np.abs(moves - other[:, None, None]) ** self._power
        return changes
