"""Local search: objects take their best paths around the others, as long as that makes an answer cheaper."""

from __future__ import annotations

import numpy as np

from tracking.boxes import Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.budget import BudgetMeter
from tracking.solvers.objective import Ints, locations_at, path_cost, path_costs, total_cost
from tracking.solvers.sparse_trellis import SparseTrellis
from tracking.solvers.viterbi import Paths, PrunedStates, Trellis, best_paths

_MAX_ROUNDS = 20
"""Limit of the rounds, far above what convergence takes."""

_MIN_IMPROVEMENT = 1e-12
"""Relative improvement below which costs count as equal."""


class LocalSearch:
    """Coordinate descent over the objects of one network; `power` is that of its layout term.

    Objects are moved to `states` (n, M, S), with a layout term to `arcs`; None: to all.

    Attributes:
        meter: what limits the search.
    """

    def __init__(
        self,
        network: Network,
        power: int = 1,
        meter: BudgetMeter | None = None,
        arcs: SparseTrellis | None = None,
        states: Bools | None = None,
    ) -> None:
        self.meter = meter or BudgetMeter()
        self._descent: _TogetherDescent | _LayoutDescent
        if network.layout and network.frames > 1:
            self._descent = _LayoutDescent(network, power, self.meter, arcs)
        else:
            self._descent = _TogetherDescent(network, self.meter, states)

    def improve(self, nodes: Ints) -> Ints:
        """Return nodes (n, M) without conflicts that cost no more, from nodes without conflicts.

        They are the same nodes if the meter's budget is spent. Repairs the effects of rounding each frame
        separately (II.D): missing arcs if arcs are gated, and jumps where the relaxation was fractional.
        """
        return self._descent.improve(nodes.copy())


class _OccupiedPlaces:
    """The places that paths exclude for others."""

    def __init__(self, network: Network) -> None:
        self._network, self._exclusions = network, network.exclusions()
        self._frames = np.arange(network.frames)

    def of(self, owners: Ints, nodes: Ints) -> Bools:
        """Return the places (C, M, P K) that conflict with paths `nodes` (C, M) of `owners` (C,)."""
        network, places = self._network, self._network.max_places
        if not self._exclusions.size:
            return np.zeros((*nodes.shape, len(network.boxes) * places), dtype=np.bool_)
        visible = nodes < places
        index = np.where(visible, network.sets[owners][:, None] * places + nodes, 0)
        return np.asarray(self._exclusions[self._frames, index] & visible[:, :, None])

    def own(self, owners: Ints, occupied: Bools) -> Bools:
        """Return those of places `occupied` (C, M, P K) that are observations of `owners`, (C, M, K)."""
        sets, places = len(self._network.boxes), self._network.max_places
        by_set = occupied.reshape(*occupied.shape[:2], sets, places)
        return np.asarray(by_set[np.arange(len(owners)), :, self._network.sets[owners]])

    def are_free(self, owner: int, nodes: Ints, occupied: Bools) -> bool:
        """Return whether a path `nodes` (M,) of `owner` is outside places `occupied` (M, P K)."""
        places = self._network.max_places
        visible = np.flatnonzero(nodes < places)
        return not bool(occupied[visible, self._network.sets[owner] * places + nodes[visible]].any())


class _TogetherDescent:
    """Where only conflicts couple objects: the best paths of all around the others, in one pass a round."""

    def __init__(self, network: Network, meter: BudgetMeter, states: Bools | None = None) -> None:
        self._network, self._meter = network, meter
        usable = np.isfinite(network.node)
        self._packed = PrunedStates.of(usable if states is None else usable & states)
        self._trellis = self._packed.trellis(Trellis.of(network))
        self._places = _OccupiedPlaces(network)

    def improve(self, nodes: Ints) -> Ints:
        everybody = np.arange(self._network.objects)
        for _ in range(_MAX_ROUNDS):
            if self._meter.reached():
                break
            occupied = self._places.of(everybody, nodes)
            by_others = np.asarray(occupied.sum(axis=0) - occupied > 0)
            found = self._cheapest_around(self._places.own(everybody, by_others))
            costs = path_costs(self._network, nodes)
            gains = np.zeros(len(costs))
            np.subtract(costs, found.costs, out=gains, where=np.isfinite(found.costs))
            gains[gains < _MIN_IMPROVEMENT * np.maximum(1.0, np.abs(found.costs))] = 0.0
            if not gains.any():
                break
            self._move(nodes, found, gains)
        return nodes

    def _cheapest_around(self, excluded: Bools) -> Paths:
        """Return the best paths outside places `excluded` (n, M, K)."""
        barred = np.zeros(self._network.node.shape)
        barred[:, :, :-1][excluded] = np.inf
        node = self._trellis.node + self._packed.states(barred, np.inf)
        self._meter.add_step()
        self._meter.add_passes(*node.shape)
        found = best_paths(self._trellis.with_node(node))
        return Paths(self._packed.original_states(found.nodes), found.costs)

    def _move(self, nodes: Ints, found: Paths, gains: Floats) -> None:
        """Move objects in `nodes` to found paths, who gains most first, if nobody has come in their way."""
        occupied = self._places.of(np.arange(len(nodes)), found.nodes)
        moved: list[int] = []
        for owner in np.argsort(-gains, kind="stable")[: np.count_nonzero(gains)].tolist():
            if self._places.are_free(owner, found.nodes[owner], np.asarray(occupied[moved].any(axis=0))):
                moved.append(owner)
        nodes[moved] = found.nodes[moved]


class _LayoutDescent:
    """Where movements are compared with those of all others: one object after another."""

    def __init__(
        self, network: Network, power: int, meter: BudgetMeter, arcs: SparseTrellis | None = None
    ) -> None:
        self._network, self._power, self._meter = network, power, meter
        self._trellis = SparseTrellis.of(network) if arcs is None else arcs
        self._meter.add_arcs(network.objects, len(self._trellis))
        movements = self._trellis.movements(network.locations)
        self._changes = [MovementChanges(self._trellis, own, power) for own in movements]
        self._places = _OccupiedPlaces(network)

    def improve(self, nodes: Ints) -> Ints:
        cost = total_cost(self._network, nodes, self._power)
        settled = np.zeros(self._network.objects, dtype=np.bool_)
        for _ in range(_MAX_ROUNDS):
            for owner in range(self._network.objects):
                # An object is settled until another one moves.
                if not settled[owner] and not self._meter.reached():
                    if self._reroute(owner, nodes):
                        settled[:] = False
                    settled[owner] = True
            before, cost = cost, total_cost(self._network, nodes, self._power)
            if settled.all() or not cost < before - _MIN_IMPROVEMENT * max(1.0, abs(cost)):
                break
        return nodes

    def _reroute(self, owner: int, nodes: Ints) -> bool:
        """Move one object to its best path around the others, in `nodes`; return whether it moved."""
        network, trellis = self._network, self._trellis
        moves = np.diff(locations_at(network, nodes), axis=1)
        cost = path_cost(network, nodes[owner], owner)
        cost += network.layout * float((np.abs(moves - moves[owner]) ** self._power).sum())
        others = np.delete(np.arange(network.objects), owner)
        occupied = np.asarray(self._places.of(others, nodes[others]).any(axis=0, keepdims=True))
        excluded = self._places.own(np.array([owner]), occupied)
        barred = np.zeros((1, network.frames, trellis.states))
        barred[:, :, :-1][excluded] = np.inf
        changes = self._changes[network.sets[owner]].sums(moves[others])
        self._meter.add_step()
        self._meter.add_arcs(1, len(trellis))
        costs = trellis.costs[owner] + network.layout * changes + trellis.nodes(barred)
        forward = trellis.forward(costs)
        if not forward[-1].min() < cost - _MIN_IMPROVEMENT * max(1.0, abs(cost)):
            return False
        nodes[owner] = trellis.best_paths(costs, forward).nodes[0]
        return True


class MovementChanges:
    """How much the movement of each arc of a trellis differs from those of other objects, over all sides."""

    def __init__(self, trellis: SparseTrellis, movements: Floats, power: int = 1) -> None:
        """Sort the movements (E, 4) of the arcs, pixels, step by step; `power` is that of the differences."""
        self._power, self._step = power, trellis.step
        self._movements = movements
        # Movements of later steps are put behind those of earlier ones, so that one search is for all steps.
        self._apart = 4.0 * float(np.abs(movements).max(initial=1.0)) + 1.0
        self._orders = [np.lexsort((side, trellis.step)) for side in movements.T]
        self._sorted = [side[order] for side, order in zip(movements.T, self._orders, strict=True)]
        self._keys = [known + self._apart * trellis.step for known in self._sorted]

    def sums(self, others: Floats) -> Floats:
        """Return the sum of the differences from the movements `others` (N, M - 1, 4) for each arc, (E,)."""
        count, step = len(others), self._step
        if not count:
            return np.zeros(len(step))
        totals = others.sum(axis=0)
        if self._power > 1:
            squares = (others**2).sum(axis=(0, 2))[step]
            own = count * (self._movements**2).sum(axis=1)
            return np.asarray(own + squares - 2.0 * (self._movements * totals[step]).sum(axis=1))
        earlier = np.vstack([np.zeros(totals.shape[1]), np.cumsum(totals, axis=0)])
        sums = np.zeros(len(step))
        limit = 0.5 * self._apart
        for side, (order, known, keys) in enumerate(zip(self._orders, self._sorted, self._keys, strict=True)):
            found = np.clip(others[:, :, side], -limit, limit) + self._apart * np.arange(len(totals))
            places = np.searchsorted(keys, found.ravel())
            # Running sums of the movements up to each arc's own, and their number.
            below = np.cumsum(np.bincount(places, others[:, :, side].ravel(), len(step) + 1))[:-1]
            number = np.cumsum(np.bincount(places, minlength=len(step) + 1))[:-1] - count * step
            below -= earlier[step, side]
            sums[order] += known * (2 * number - count) + totals[step, side] - 2.0 * below
        return sums
