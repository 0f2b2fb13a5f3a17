"""Cheapest paths under changing prices: only what a price touches is computed again."""

from __future__ import annotations

from tracking.boxes import Floats
from tracking.solvers.objective import Ints
from tracking.solvers.viterbi import Paths, Trellis, forward, trace


class Pricing:
    """Answers for one trellis under many node costs.

    Attributes:
        trellis: the trellis without prices.
        ahead: its `forward` pass, (M, n, S).
        alone: the cheapest paths without prices.
    """

    def __init__(self, trellis: Trellis) -> None:
        self.trellis = trellis
        self.ahead = forward(trellis)
        self.alone = trace(trellis, self.ahead)
        self._node = trellis.node.copy()
        self._paths = Paths(self.alone.nodes.copy(), self.alone.costs.copy())

    def best_paths(self, node: Floats, objects: Ints) -> Paths:
        """Give the cheapest paths of `objects` at the costs `node` (n, M, S)."""
        touched = objects[(node[objects] != self._node[objects]).any(axis=(1, 2))]
        if len(touched):
            self._node[touched] = node[touched]
            trellis = self.trellis.with_node(node).only(touched)
            # Up to the first frame with a price the ways are those without prices.
            priced = (trellis.node != self.trellis.node[touched]).any(axis=(0, 2))
            first = int(priced.argmax()) if priced.any() else len(priced)
            paths = trace(trellis, forward(trellis, self.ahead[:first, touched]))
            self._paths.nodes[touched] = paths.nodes
            self._paths.costs[touched] = paths.costs
        return self._paths.only(objects)
