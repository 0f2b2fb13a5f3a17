"""Independent shortest paths of all objects: the Viterbi algorithm over a window."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.arc_lists import StepArcs, existing_arcs, group_by_step
from tracking.solvers.objective import Ints

_MOST_LISTED, _LEAST_OBJECTS, _LEAST_STATES = 0.2, 6, 16
"""Arcs are listed if no more than this share of the pairs of states has one, and there are so many objects
and states: lists of few arcs are no faster than all pairs."""


@dataclass(frozen=True, slots=True, eq=False)
class _ListedArcs:
    """The arcs that any object has: steps, and their costs (Q, E), infinite where an object lacks one."""

    steps: tuple[StepArcs, ...]
    costs: Floats

    @classmethod
    def of(cls, network: Network) -> _ListedArcs | None:
        """List the arcs of a network if they are few."""
        steps, states = network.frames - 1, network.max_places + 1
        if not steps or states < _LEAST_STATES or network.objects < _LEAST_OBJECTS:
            return None
        step, origin, target = existing_arcs(network.pair, network.node)
        if len(step) > _MOST_LISTED * steps * states**2:
            return None
        costs = network.pair[:, step, origin, target]
        return cls(group_by_step(steps, step, origin, target), costs)

    def select(self, chosen: NDArray[np.int64]) -> _ListedArcs:
        """Return the arcs of some of the objects."""
        return self if len(self.costs) == 1 else _ListedArcs(self.steps, self.costs[chosen])


@dataclass(frozen=True, slots=True, eq=False)
class Trellis:
    """Costs of the arcs of n objects; `node` may include duals or blocked places.

    Attributes:
        source, node, pair, sink: as in `Network`; `node` is (n, M, S), `pair` (P, M - 1, S, S).
        chosen: (n,) the sets of `pair` of these objects; None: all in order, or the only one.
        listed: the arcs in lists, if they are few.
    """

    source: Floats
    node: Floats
    pair: Floats
    sink: Floats
    chosen: NDArray[np.int64] | None = None
    listed: _ListedArcs | None = None

    @classmethod
    def of(cls, network: Network) -> Trellis:
        """Return the trellis of a network without prices."""
        listed = _ListedArcs.of(network)
        return cls(network.source, network.node, network.pair, network.sink, listed=listed)

    def select(self, objects: NDArray[np.int64]) -> Trellis:
        """Return the trellis of some of the objects."""
        return Trellis(
            self.source[objects],
            self.node[objects],
            self.pair,
            self.sink[objects],
            None if len(self.pair) == 1 else objects if self.chosen is None else self.chosen[objects],
            self.listed.select(objects) if self.listed else None,
        )

    def with_node(self, node: Floats) -> Trellis:
        """Return the trellis with other node costs."""
        return replace(self, node=node)

    @property
    def sets(self) -> NDArray[np.int64]:
        """The index into `pair` of each object, (n,)."""
        if len(self.pair) == 1:
            return np.zeros(len(self.node), dtype=np.int64)
        return np.arange(len(self.node)) if self.chosen is None else self.chosen

    def step_pairs(self, step: int) -> Floats:
        """Return the costs of the arcs of a step, (n or 1, S, S)."""
        return self.pair[:, step] if self.chosen is None else self.pair[self.chosen, step]


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """One path for each object.

    Attributes:
        nodes: (n, M) int64, the state in each frame, S - 1 if occluded.
        costs: (n,) the costs of the paths, source to sink.
    """

    nodes: NDArray[np.int64]
    costs: Floats

    def select(self, chosen: NDArray[np.int64]) -> Paths:
        """Return the paths of some of the objects."""
        return Paths(self.nodes[chosen], self.costs[chosen])


def forward(trellis: Trellis, known: Floats | None = None) -> Floats:
    """Return the cost of the best path from the source to each state, its node included, (M, n, S).

    `known` (F, n, S): the result for the first F frames, if known.
    """
    objects, frames, states = trellis.node.shape
    best = np.empty((frames, objects, states))
    first = 1
    if known is not None and len(known):
        best[: len(known)], first = known, len(known)
    else:
        best[0] = trellis.source + trellis.node[:, 0]
    if trellis.listed:
        for m, arcs in enumerate(trellis.listed.steps[first - 1 :], first):
            through = best[m - 1][:, arcs.origin]
            through += trellis.listed.costs[:, arcs.span]
            best[m] = np.inf
            best[m][:, arcs.entering.states] = np.minimum.reduceat(through, arcs.entering.starts, axis=1)
            best[m] += trellis.node[:, m]
        return best
    costs = np.empty((objects, states, states))
    for m in range(first, frames):
        np.add(best[m - 1][:, :, None], trellis.step_pairs(m - 1), out=costs)
        np.minimum.reduce(costs, axis=1, out=best[m])
        best[m] += trellis.node[:, m]
    return best


def backward(trellis: Trellis) -> Floats:
    """Return the cost of the best path from each state to the sink, its node excluded, (M, n, S)."""
    objects, frames, states = trellis.node.shape
    best = np.empty((frames, objects, states))
    best[-1] = trellis.sink
    if trellis.listed:
        for m in range(frames - 2, -1, -1):
            arcs = trellis.listed.steps[m]
            through = (best[m + 1] + trellis.node[:, m + 1])[:, arcs.target]
            through += trellis.listed.costs[:, arcs.span]
            through, leaving = through[:, arcs.order], arcs.leaving
            best[m] = np.inf
            best[m][:, leaving.states] = np.minimum.reduceat(through, leaving.starts, axis=1)
        return best
    costs = np.empty((objects, states, states))
    for m in range(frames - 2, -1, -1):
        ahead = best[m + 1] + trellis.node[:, m + 1]
        np.add(trellis.step_pairs(m), ahead[:, None], out=costs)
        np.minimum.reduce(costs, axis=2, out=best[m])
    return best


def trace_back(trellis: Trellis, best: Floats) -> Paths:
    """Trace the result of `forward` back from the sink; ties go to the lowest state."""
    objects, frames, _ = trellis.node.shape
    each, sets = np.arange(objects), trellis.sets
    nodes = np.empty((objects, frames), dtype=np.int64)
    ends = best[-1] + trellis.sink
    nodes[:, -1] = ends.argmin(axis=1)
    for m in range(frames - 2, -1, -1):
        nodes[:, m] = (best[m] + trellis.pair[sets, m, :, nodes[:, m + 1]]).argmin(axis=1)
    return Paths(nodes, ends[each, nodes[:, -1]])


@dataclass(frozen=True, slots=True, eq=False)
class MinMarginals:
    """Forward and backward pass over a trellis: costs of the best paths to and from each state.

    Attributes:
        forward: (M, n, S) from the source to each state, its node included.
        backward: (M, n, S) from each state to the sink, its node excluded.
        least: (n,) the costs of the cheapest paths.
    """

    forward: Floats
    backward: Floats
    least: Floats

    @classmethod
    def of(cls, trellis: Trellis, known_forward: Floats | None = None) -> MinMarginals:
        """Run both passes; `known_forward` is the forward pass, if known."""
        forward_costs = forward(trellis) if known_forward is None else known_forward
        return cls(forward_costs, backward(trellis), (forward_costs[-1] + trellis.sink).min(axis=1))

    @property
    def through(self) -> Floats:
        """The cost of the best path through each state, (n, M, S)."""
        return np.swapaxes(self.forward + self.backward, 0, 1)


def best_paths(trellis: Trellis) -> Paths:
    """Return the cheapest path of each object independently."""
    return trace_back(trellis, forward(trellis))


@dataclass(frozen=True, slots=True, eq=False)
class PrunedStates:
    """The kept states in W slots per object and frame, in ascending order; empty slots are last.

    Attributes:
        index: (n, M, W) the state in each slot; arbitrary in an empty one.
        filled: (n, M, W) False in empty slots.
    """

    index: Ints
    filled: Bools

    @classmethod
    def of(cls, kept: Bools) -> PrunedStates:
        """Keep the states where `kept` (n, M, S) is true."""
        counts = kept.sum(axis=2)
        width = int(counts.max(initial=1))
        index = np.argsort(~kept, axis=2, kind="stable")[:, :, :width]
        return cls(index, np.arange(width) < counts[:, :, None])

    @classmethod
    def cheapest(cls, costs: Floats, count: int) -> PrunedStates:
        """Keep the `count` cheapest states per object and frame by `costs` (n, M, S)."""
        if count < costs.shape[2]:
            index = np.sort(np.argpartition(costs, count - 1, axis=2)[:, :, :count], axis=2)
        else:
            index = np.broadcast_to(np.arange(costs.shape[2]), costs.shape)
        return cls(index, np.ones(index.shape, dtype=np.bool_))

    def states(self, values: Floats, empty: float) -> Floats:
        """Return values of states, (n, M, S, ...) to (n, M, W, ...); empty slots have `empty`."""
        objects, frames = self.index.shape[:2]
        packed = values[np.arange(objects)[:, None, None], np.arange(frames)[:, None], self.index]
        packed[~self.filled] = empty
        return packed

    def pairs(self, trellis: Trellis) -> Floats:
        """Return the costs of the arcs of a trellis, (n, M - 1, W, W)."""
        step = np.arange(self.index.shape[1] - 1)[:, None, None]
        origin, target = self.index[:, :-1, :, None], self.index[:, 1:, None, :]
        return np.asarray(trellis.pair[trellis.sets[:, None, None, None], step, origin, target])

    def trellis(self, trellis: Trellis) -> Trellis:
        """Return the trellis of the kept states."""
        each = np.arange(len(self.index))[:, None]
        return Trellis(
            trellis.source[each, self.index[:, 0]],
            self.states(trellis.node, np.inf),
            self.pairs(trellis),
            trellis.sink[each, self.index[:, -1]],
        )

    def original_states(self, slots: Ints) -> Ints:
        """Return the states in slots, both (n, M)."""
        return np.asarray(np.take_along_axis(self.index, slots[:, :, None], axis=2)[:, :, 0])


class PathPricer:
    """Cheapest paths of one trellis for changing node costs, computed only where costs changed.

    Attributes:
        trellis: the trellis without prices.
        forward: its forward pass, (M, n, S).
        alone: the cheapest paths without prices.
    """

    def __init__(self, trellis: Trellis) -> None:
        self.trellis = trellis
        self.forward = forward(trellis)
        self.alone = trace_back(trellis, self.forward)
        self._node = trellis.node.copy()
        self._paths = Paths(self.alone.nodes.copy(), self.alone.costs.copy())

    def best_paths(self, node: Floats, objects: Ints) -> Paths:
        """Return the cheapest paths of `objects` at the costs `node` (n, M, S)."""
        touched = objects[(node[objects] != self._node[objects]).any(axis=(1, 2))]
        if len(touched):
            self._node[touched] = node[touched]
            trellis = self.trellis.with_node(node).select(touched)
            # Before the first frame with a price the forward pass is that without prices.
            priced = (trellis.node != self.trellis.node[touched]).any(axis=(0, 2))
            first = int(priced.argmax()) if priced.any() else len(priced)
            paths = trace_back(trellis, forward(trellis, self.forward[:first, touched]))
            self._paths.nodes[touched] = paths.nodes
            self._paths.costs[touched] = paths.costs
        return self._paths.select(objects)
