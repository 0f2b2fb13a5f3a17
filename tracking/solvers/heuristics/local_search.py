"""Local search: one object after another takes its best path around the others."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from tracking.boxes import Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.budget import BudgetMeter
from tracking.solvers.objective import Ints, locations_at, path_cost, total_cost
from tracking.solvers.sparse_trellis import SparseTrellis
from tracking.solvers.viterbi import MinMarginals, Paths, PrunedStates, Trellis, best_paths, trace_back

_MAX_ROUNDS = 20
"""Limit of the rounds, far above what convergence takes."""

_MIN_IMPROVEMENT = 1e-12
"""Relative improvement below which costs count as equal."""


class LocalSearch:
    """Coordinate descent over the objects of one network; `power` is that of its layout term.

    With a layout term, `arcs` are those that objects may be moved to; None: all.

    Attributes:
        meter: what limits the search.
    """

    def __init__(
        self,
        network: Network,
        power: int = 1,
        meter: BudgetMeter | None = None,
        arcs: SparseTrellis | None = None,
    ) -> None:
        self._network = network
        self._power = power
        self.meter = meter or BudgetMeter()
        self._paths: _PathsAlone | _PathsInLayout
        if network.layout and network.frames > 1:
            self._paths = _PathsInLayout(network, power, self.meter, arcs)
        else:
            self._paths = _PathsAlone(network, self.meter)

    @property
    def alone(self) -> Paths:
        """The cheapest path of each object without regard to the others."""
        return self._paths.alone

    def improve(self, nodes: Ints, bound: float = -np.inf) -> Ints:
        """Return nodes (n, M) without conflicts that cost no more, from nodes without conflicts.

        They are the same nodes if the meter's budget is spent. It ends when they cost no more than `bound`.
        Repairs the effects of rounding each frame separately (II.D): missing arcs if arcs are gated, and
        jumps where the relaxation was fractional.
        """
        descent = _CoordinateDescent(self._network, self._paths, self._power, self.meter, nodes)
        cost = total_cost(self._network, nodes, self._power)
        for _ in range(_MAX_ROUNDS):
            if cost <= bound:
                break
            changed = [descent.reroute(owner) for owner in range(self._network.objects)]
            before, cost = cost, total_cost(self._network, descent.nodes, self._power)
            if not any(changed) or not cost < before - _MIN_IMPROVEMENT * max(1.0, abs(cost)):
                break
        return descent.nodes


class _PathsAlone:
    """Best paths of single objects where only conflicts couple them."""

    def __init__(self, network: Network, meter: BudgetMeter) -> None:
        self._network, self._meter = network, meter
        meter.add_passes(*network.node.shape)
        meter.add_passes(*network.node.shape)
        self._trellis = Trellis.of(network)
        passes = MinMarginals.of(self._trellis)
        self._through = passes.through
        self.alone = trace_back(self._trellis, passes.forward)

    def cheaper(self, owner: int, _nodes: Ints, excluded: Bools, cost: float) -> Ints | None:
        """Return the best path (M,) of one object outside places `excluded` (M, K) if it is below `cost`."""
        limit = cost + _MIN_IMPROVEMENT * max(1.0, abs(cost)) if np.isfinite(cost) else np.inf
        node = self._network.node[owner].copy()
        node[:, :-1][excluded] = np.inf
        packed = PrunedStates.of(((self._through[owner] <= limit) & np.isfinite(node))[None])
        self._meter.add_passes(1, self._network.frames, packed.index.shape[2])
        trellis = packed.trellis(self._trellis.select(np.array([owner])).with_node(node[None]))
        found = best_paths(trellis)
        return packed.original_states(found.nodes)[0] if found.costs[0] < cost else None


class _PathsInLayout:
    """Best paths of single objects whose movements are compared with those of all others."""

    def __init__(
        self, network: Network, power: int, meter: BudgetMeter, arcs: SparseTrellis | None = None
    ) -> None:
        self._network, self._meter = network, meter
        self._trellis = SparseTrellis.of(network) if arcs is None else arcs
        self._meter.add_arcs(network.objects, len(self._trellis))
        movements = self._trellis.movements(network.locations)
        self._changes = [MovementChanges(self._trellis, own, power) for own in movements]

    @cached_property
    def alone(self) -> Paths:
        return best_paths(Trellis.of(self._network))

    def cheaper(self, owner: int, nodes: Ints, excluded: Bools, cost: float) -> Ints | None:
        """Return the best path (M,) of one object outside places `excluded` (M, K) if it is below `cost`.

        The others are at `nodes`.
        """
        network, trellis = self._network, self._trellis
        others = np.diff(np.delete(locations_at(network, nodes), owner, axis=0), axis=1)
        changes = self._changes[network.sets[owner]].sums(others)
        barred = np.zeros((1, network.frames, trellis.states))
        barred[0, :, :-1][excluded] = np.inf
        self._meter.add_arcs(1, len(trellis))
        costs = trellis.costs[owner] + network.layout * changes + trellis.nodes(barred)
        forward = trellis.forward(costs)
        return trellis.best_paths(costs, forward).nodes[0] if forward[-1].min() < cost else None


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


class _CoordinateDescent:
    """Reroutes one object after another; an object is skipped if no other has moved since its last turn."""

    def __init__(
        self,
        network: Network,
        paths: _PathsAlone | _PathsInLayout,
        power: int,
        meter: BudgetMeter,
        nodes: Ints,
    ) -> None:
        self._network, self._paths, self._power, self._meter = network, paths, power, meter
        self._exclusions = network.exclusions()
        self._settled = np.zeros(network.objects, dtype=np.bool_)
        self.nodes = nodes.copy()

    def reroute(self, owner: int) -> bool:
        """Move one object to its best path around the others; return whether it moved."""
        if self._settled[owner] or self._meter.reached():
            return False
        cost = self._own_cost(owner)
        least = self._paths.alone.costs[owner]
        if np.isfinite(cost) and cost <= least + _MIN_IMPROVEMENT * max(1.0, abs(cost)):
            return False
        self._meter.add_step()
        path = self._paths.cheaper(owner, self.nodes, self._excluded(owner), cost)
        moved = path is not None
        if path is not None:
            self.nodes[owner] = path
            self._settled[:] = False
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
