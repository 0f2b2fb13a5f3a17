"""The arcs that exist, in lists: gated windows have a tenth of the pairs of states or fewer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tracking.boxes import Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.arc_lists import StepArcs, existing_arcs, group_by_step
from tracking.solvers.objective import Ints
from tracking.solvers.viterbi import Paths

_WORTH_SORTING = 0.1
"""Fewer arcs than this share of all are sorted anew rather than picked from the known order."""


@dataclass(frozen=True, eq=False)
class SparseTrellis:
    """The arcs that any object has; costs of arcs are (n, E), infinite where an object lacks one.

    Attributes:
        states: the number S of states.
        sets: (n,) which set of arcs of the network each object has.
        step, origin, target: (E,) the frame that each arc leaves, and its states; sorted by step, target,
            origin.
        costs: (n, E) without prices; nodes, source and sink are included in the arcs into or from them.
        steps: the arcs of each step, M - 1.
    """

    states: int
    sets: Ints
    step: Ints
    origin: Ints
    target: Ints
    costs: Floats
    steps: tuple[StepArcs, ...]

    @classmethod
    def of(cls, network: Network) -> SparseTrellis:
        """List the arcs of a network of two frames at least, whose objects may all hide."""
        step, origin, target = existing_arcs(network.pair, network.node)
        steps = group_by_step(network.frames - 1, step, origin, target)
        costs = network.pair[:, step, origin, target][network.pair_sets]
        trellis = cls(network.max_places + 1, network.pair_sets, step, origin, target, costs, steps)
        costs += trellis.nodes(network.node)
        first, last = steps[0].span, steps[-1].span
        costs[:, first] += network.source[:, origin[first]]
        costs[:, last] += network.sink[:, target[last]]
        return trellis

    def select(self, kept: Bools) -> SparseTrellis:
        """Return the trellis of the arcs where `kept` (E,) is true, at least one in each step."""
        if kept.all():
            return self
        index = np.flatnonzero(kept)
        step, origin, target = self.step[index], self.origin[index], self.target[index]
        order = None
        if len(index) > _WORTH_SORTING * len(kept):
            order = (np.cumsum(kept) - 1)[self.by_origin[kept[self.by_origin]]]
        steps = group_by_step(len(self.steps), step, origin, target, order)
        costs = self.costs.take(index, axis=1)
        return SparseTrellis(self.states, self.sets, step, origin, target, costs, steps)

    def __len__(self) -> int:
        """The number E of arcs."""
        return len(self.step)

    def pairs(self, pair: Floats) -> Floats:
        """Return the values of `Network.pair`, (Q, M - 1, S, S), of all arcs, (n, E)."""
        return np.asarray(pair[:, self.step, self.origin, self.target][self.sets])

    def nodes(self, node: Floats) -> Floats:
        """Return the values of nodes (n, M, S) on arcs into them, (n, E), those of the first frame too."""
        values = node[:, self.step + 1, self.target]
        first = self.steps[0]
        values[:, first.span] += node[:, 0, first.origin]
        return np.asarray(values)

    def differences(self, potentials: Floats) -> Floats:
        """Return how much potentials (n, M, S) rise along each arc, (n, E)."""
        rise = potentials[:, self.step + 1, self.target] - potentials[:, self.step, self.origin]
        return np.asarray(rise)

    def movements(self, locations: Floats) -> Floats:
        """Return the movements along each arc, (P, E, 4), between locations (P, M, S, 4), pixels."""
        after = locations[:, self.step + 1, self.target]
        return np.asarray(after - locations[:, self.step, self.origin])

    @cached_property
    def by_origin(self) -> Ints:
        """The order of all arcs by step, origin, target."""
        return np.concatenate([arcs.order + arcs.span.start for arcs in self.steps])

    def forward(self, costs: Floats) -> Floats:
        """Return the cost of the best path to each state, (M, n, S), from costs of arcs (n, E)."""
        best = np.full((len(self.steps) + 1, len(costs), self.states), np.inf)
        best[0] = 0.0
        for m, arcs in enumerate(self.steps):
            through = best[m][:, arcs.origin]
            through += costs[:, arcs.span]
            entering = arcs.entering
            best[m + 1][:, entering.states] = np.minimum.reduceat(through, entering.starts, axis=1)
        return best

    def backward(self, costs: Floats) -> Floats:
        """Return the cost of the best path from each state, (M, n, S), from costs of arcs (n, E)."""
        best = np.full((len(self.steps) + 1, len(costs), self.states), np.inf)
        best[-1] = 0.0
        ordered = costs[:, self.by_origin]
        for m in range(len(self.steps) - 1, -1, -1):
            arcs = self.steps[m]
            through = best[m + 1][:, arcs.target[arcs.order]]
            through += ordered[:, arcs.span]
            best[m][:, arcs.leaving.states] = np.minimum.reduceat(through, arcs.leaving.starts, axis=1)
        return best

    def best_paths(self, costs: Floats, forward: Floats | None = None) -> Paths:
        """Return the cheapest path of each of the objects of `costs` (n, E); ties go to the lowest state.

        `forward`: the result of the forward pass, if known.
        """
        best = self.forward(costs) if forward is None else forward
        objects = len(costs)
        nodes = np.empty((objects, len(best)), dtype=np.int64)
        nodes[:, -1] = best[-1].argmin(axis=1)
        for m in range(len(best) - 2, -1, -1):
            arcs = self.steps[m]
            through = best[m][:, arcs.origin] + costs[:, arcs.span]
            through[arcs.target != nodes[:, m + 1, None]] = np.inf
            nodes[:, m] = arcs.origin[through.argmin(axis=1)]
        return Paths(nodes, best[-1].min(axis=1))

    def dense(self, values: Floats) -> Floats:
        """Return values of arcs (n, E) as (n, M - 1, S, S), infinite where there is no arc."""
        pair = np.full((len(values), len(self.steps), self.states, self.states), np.inf)
        pair[:, self.step, self.origin, self.target] = values
        return pair

    def excess(self, costs: Floats, forward: Floats, backward: Floats) -> Floats:
        """Return how much more the best path through each arc costs than the best path, (n, E).

        `forward` and `backward` are the results of these passes at the costs (n, E).
        """
        through = costs.copy()
        for m, arcs in enumerate(self.steps):
            through[:, arcs.span] += forward[m][:, arcs.origin]
            through[:, arcs.span] += backward[m + 1][:, arcs.target]
        through -= forward[-1].min(axis=1)[:, None]
        return through
