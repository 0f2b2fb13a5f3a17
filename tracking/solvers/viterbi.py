"""Shortest paths of all objects at once, each on its own: the Viterbi algorithm over a window."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats
from tracking.network import Network


@dataclass(frozen=True, slots=True, eq=False)
class Trellis:
    """The arcs of n objects that are priced together; `node` may carry duals or blocked places.

    Attributes:
        source, node, pair, sink: as in `Network`; `node` is (n, M, S), `pair` (P, M - 1, S, S).
    """

    source: Floats
    node: Floats
    pair: Floats
    sink: Floats

    @classmethod
    def of(cls, network: Network) -> Trellis:
        """Give the trellis of a network as it is."""
        return cls(network.source, network.node, network.pair, network.sink)

    def only(self, chosen: NDArray[np.int64]) -> Trellis:
        """Give the trellis of some of the objects."""
        pair = self.pair if len(self.pair) == 1 else self.pair[chosen]
        return Trellis(self.source[chosen], self.node[chosen], pair, self.sink[chosen])

    def with_node(self, node: Floats) -> Trellis:
        """Give the trellis with other costs of being in a state."""
        return Trellis(self.source, node, self.pair, self.sink)


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """One path for each object.

    Attributes:
        nodes: (n, M) int64, the state in each frame, S - 1 where occluded.
        costs: (n,) the costs of the paths, source to sink.
    """

    nodes: NDArray[np.int64]
    costs: Floats

    def only(self, chosen: NDArray[np.int64]) -> Paths:
        """Give the paths of some of the objects."""
        return Paths(self.nodes[chosen], self.costs[chosen])


def forward(trellis: Trellis, known: Floats | None = None) -> Floats:
    """Give the cost of the best way from the source into each state, the state counted, (M, n, S).

    `known` (F, n, S), where given, is the answer for the first F frames.
    """
    objects, frames, states = trellis.node.shape
    best = np.empty((frames, objects, states))
    first = 1
    if known is not None and len(known):
        best[: len(known)], first = known, len(known)
    else:
        best[0] = trellis.source + trellis.node[:, 0]
    ways = np.empty((objects, states, states))
    for m in range(first, frames):
        np.add(best[m - 1][:, :, None], trellis.pair[:, m - 1], out=ways)
        np.minimum.reduce(ways, axis=1, out=best[m])
        best[m] += trellis.node[:, m]
    return best


def backward(trellis: Trellis) -> Floats:
    """Give the cost of the best way from each state to the sink, the state not counted, (M, n, S)."""
    objects, frames, states = trellis.node.shape
    best = np.empty((frames, objects, states))
    best[-1] = trellis.sink
    ways = np.empty((objects, states, states))
    for m in range(frames - 2, -1, -1):
        ahead = best[m + 1] + trellis.node[:, m + 1]
        np.add(trellis.pair[:, m], ahead[:, None], out=ways)
        np.minimum.reduce(ways, axis=2, out=best[m])
    return best


def trace(trellis: Trellis, best: Floats) -> Paths:
    """Follow `forward` back from the sink; of equal ways the one through the lowest state is taken."""
    objects, frames, _ = trellis.node.shape
    each = np.arange(objects)
    sets = each if len(trellis.pair) == objects else np.zeros(objects, dtype=np.int64)
    nodes = np.empty((objects, frames), dtype=np.int64)
    ends = best[-1] + trellis.sink
    nodes[:, -1] = ends.argmin(axis=1)
    for m in range(frames - 2, -1, -1):
        nodes[:, m] = (best[m] + trellis.pair[sets, m, :, nodes[:, m + 1]]).argmin(axis=1)
    return Paths(nodes, ends[each, nodes[:, -1]])


@dataclass(frozen=True, slots=True, eq=False)
class Marginals:
    """Both passes over a trellis: what the best ways into and out of each state cost.

    Attributes:
        ahead: (M, n, S) from the source into each state, the state counted.
        behind: (M, n, S) from each state to the sink, the state not counted.
        least: (n,) the costs of the cheapest paths.
    """

    ahead: Floats
    behind: Floats
    least: Floats

    @classmethod
    def of(cls, trellis: Trellis, ahead: Floats | None = None) -> Marginals:
        """Go over the trellis forward and backward; `ahead`, where given, is the forward pass."""
        ahead = forward(trellis) if ahead is None else ahead
        return cls(ahead, backward(trellis), (ahead[-1] + trellis.sink).min(axis=1))

    @property
    def through(self) -> Floats:
        """The cost of the best path through each state, (n, M, S)."""
        return np.swapaxes(self.ahead + self.behind, 0, 1)


def best_paths(trellis: Trellis) -> Paths:
    """Give the cheapest path of each object on its own."""
    return trace(trellis, forward(trellis))
