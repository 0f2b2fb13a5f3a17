"""Column generation over arcs: for the layout term, and for windows in which many objects meet.

The program starts with the arcs of a few paths. Its duals, of the conflict rows it breaks and of the
layout, are prices on nodes; a forward and a backward Viterbi pass over the priced network give every arc
the cost of the best path through it, and those that better the program enter. When there are none, the
passes prove the optimum.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracking.boxes import Floats
from tracking.conflicts import Bools
from tracking.network import Network
from tracking.solvers.arc_master import ArcMaster, ArcPoint, ArcSet, arcs_of_paths
from tracking.solvers.conflict_finder import ConflictFinder, ConflictRow
from tracking.solvers.layout_ascent import Guess, with_pulls
from tracking.solvers.objective import Ints
from tracking.solvers.relaxed import CLOSE, Relaxed
from tracking.solvers.viterbi import Trellis, backward, forward

_ENTERING = 150
"""ArcSet per object and round: about the arcs of a dozen paths; more only swell the program."""


class ArcSearch:
    """One search from `starts` arcs and `rows` already found; `run` it once. There is an object at least."""

    def __init__(
        self, network: Network, starts: ArcSet, rows: Sequence[ConflictRow], finder: ConflictFinder
    ) -> None:
        self._network = network
        self._trellis = Trellis.of(network)
        self._finder = finder
        self._master = self._new_master()
        # Occluded all along, an object keeps every row: the program always has a solution.
        hidden = np.full((network.objects, network.frames), network.places)
        self._master.add_arcs(arcs_of_paths(np.arange(network.objects), hidden))
        self._master.add_arcs(starts)
        self._master.add_rows(rows)

    def _new_master(self) -> ArcMaster:
        return ArcMaster(self._network)

    def enter_guess(self, guess: Guess) -> None:
        """Let in the arcs that a guess at the duals of the layout term finds good."""
        self._master.add_arcs(arcs_of_paths(guess.owners, guess.paths))
        anything = np.full(self._network.objects, np.inf)
        point = ArcPoint(0.0, np.empty(0), guess.pulls, anything, 0.0)
        self._master.add_arcs(self._better_arcs(point)[1])

    def run(self) -> Relaxed:
        """Find the optimum of the relaxation."""
        rounds, bound = 0, -np.inf
        while True:
            point = self._settled()
            rounds += 1
            bound, arcs = self._better_arcs(point)
            close = point.objective - bound <= CLOSE * max(1.0, abs(point.objective))
            if close or not self._master.add_arcs(arcs):
                return Relaxed(self._master.usage(), bound, self._priced(point), rounds)

    def _settled(self) -> ArcPoint:
        """Solve the program with all conflict rows that its solution breaks."""
        point = self._master.solve()
        while rows := self._finder.broken(self._master.usage()):
            self._master.add_rows(rows)
            point = self._master.solve()
        return point

    def _better_arcs(self, point: ArcPoint) -> tuple[float, ArcSet]:
        """Price all arcs; give the bound that proves, and the arcs whose best path betters the program."""
        trellis = self._trellis.with_node(self._priced(point))
        ahead, behind = forward(trellis), backward(trellis)
        least = (ahead[-1] + trellis.sink).min(axis=1)
        bound = float(least.sum()) - point.charge
        found = [_first_arcs(trellis, behind, point.worths)]
        for m in range(1, self._network.frames):
            rest = (trellis.node[:, m] + behind[m])[:, None]
            through = ahead[m - 1][:, :, None] + trellis.pair[:, m - 1] + rest
            n, i, j = np.nonzero(through < point.worths[:, None, None])
            found.append((ArcSet(n, np.full(len(n), m), i, j), through[n, i, j]))
        arcs, costs = found[0][0], np.concatenate([costs for _, costs in found])
        for more, _ in found[1:]:
            arcs = arcs.and_also(more)
        return bound, arcs.only(_cheapest(arcs.owner, costs, self._network.objects))

    def _priced(self, point: ArcPoint) -> Floats:
        """Give the node costs with the prices of conflict rows and what moves earn."""
        network = self._network
        node = network.node.copy()
        for price, row in zip(point.prices, self._master.rows, strict=True):
            if price > 0.0:
                node[:, row.frame][row.members] += price
        return with_pulls(network, node, point.pulls) if network.layout else node


def _first_arcs(trellis: Trellis, behind: Floats, worths: Floats) -> tuple[ArcSet, Floats]:
    through = trellis.source + trellis.node[:, 0] + behind[0]
    n, j = np.nonzero(through < worths[:, None])
    zero = np.zeros(len(n), dtype=np.int64)
    return ArcSet(n, zero, zero, j), through[n, j]


def _cheapest(owner: Ints, costs: Floats, objects: int) -> Bools:
    """Say which arcs are among the cheapest of their object; whole paths, since equal costs go together."""
    kept = np.ones(len(owner), dtype=np.bool_)
    for n in range(objects):
        own = owner == n
        if own.sum() > _ENTERING:
            kept[own] = costs[own] <= np.partition(costs[own], _ENTERING)[_ENTERING] + 1e-12
    return kept
