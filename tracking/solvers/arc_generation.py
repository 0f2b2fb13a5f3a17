"""Column generation over arcs: for the layout term, and for windows in which many objects meet.

The program starts with the arcs of a few paths. Its duals, of the conflict rows it breaks and of the
layout, are prices on nodes; a forward and a backward Viterbi pass over the priced network give every arc
the cost of the best path through it, and those that better the program enter. When there are none, the
passes prove the optimum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.arc_master import ArcMaster, ArcMasterSolution, ArcSet, find_improving_arcs, path_arcs
from tracking.solvers.cutting_planes import ConflictRow, ConflictSeparator, conflict_prices
from tracking.solvers.dual_ascent import DualGuess, add_layout_prices, guess_duals
from tracking.solvers.objective import Ints
from tracking.solvers.relaxation import OPTIMALITY_TOLERANCE, RelaxedSolution, add_conflict_prices
from tracking.solvers.viterbi import MinMarginals, PathPricer, Trellis, forward

_ARCS_WITH_LAYOUT, _ARCS = 300, 100
"""Arcs per object and round: about those of some paths; more only swell the program."""

_STATES_WITH_LAYOUT, _STATES = 12, 6
"""States of a frame and object whose arcs are looked at first, the best: most rounds need no more."""


@dataclass(frozen=True, slots=True, eq=False)
class _PricedTrellis:
    """The trellis at the prices of a point, the forward pass over it, and the bound that they prove."""

    trellis: Trellis
    forward: Floats
    reduced_cost_limits: Floats
    bound: float


class ArcGeneration:
    """One search from `starts` arcs and `rows` already found; `run` it once. There is an object at least."""

    def __init__(
        self, network: Network, starts: ArcSet, rows: Sequence[ConflictRow], finder: ConflictSeparator
    ) -> None:
        self._network = network
        self._trellis = Trellis.of(network)
        self._finder = finder
        self._master = self._new_master()
        # Occluded all along, an object keeps every row: the program always has a solution.
        hidden = np.full((network.objects, network.frames), network.places)
        self._master.add_arcs(path_arcs(np.arange(network.objects), hidden))
        self._master.add_arcs(starts)
        self._master.add_rows(rows)

    def _new_master(self) -> ArcMaster:
        return ArcMaster(self._network)

    def enter_guess(self, guess: DualGuess) -> None:
        """Bind the program by the rows of a guess at the duals; let in the arcs that it finds good."""
        self._master.add_rows(guess.rows)
        owners = np.tile(np.arange(self._network.objects), len(guess.paths))
        self._master.add_arcs(path_arcs(owners, np.concatenate(guess.paths)))
        anything = np.full(self._network.objects, np.inf)
        self._enter_better_arcs(
            self._priced_by(ArcMasterSolution(0.0, guess.prices, guess.layout_prices, anything, 0.0))
        )

    def run(self) -> RelaxedSolution:
        """Find the optimum of the relaxation."""
        rounds = 0
        while True:
            point = self._settled()
            rounds += 1
            priced = self._priced_by(point)
            close = point.objective - priced.bound <= OPTIMALITY_TOLERANCE * max(1.0, abs(point.objective))
            if close or not self._enter_better_arcs(priced):
                return self._relaxed(point, priced, rounds)

    def _relaxed(self, point: ArcMasterSolution, priced: _PricedTrellis, rounds: int) -> RelaxedSolution:
        charges = np.zeros(self._network.frames)
        frames = np.array([row.frame for row in self._master.rows], dtype=np.int64)
        np.add.at(charges, frames, point.prices)
        return RelaxedSolution(
            usage=self._master.usage(),
            bound=priced.bound,
            priced=priced.trellis.node,
            rounds=rounds,
            prices=conflict_prices(self._network, self._master.rows, point.prices),
            layout_prices=point.layout_prices,
            charges=charges,
        )

    def _settled(self) -> ArcMasterSolution:
        """Solve the program with all conflict rows that its solution breaks."""
        point = self._master.solve()
        while rows := self._finder.find_violated(self._master.usage()):
            self._master.add_rows(rows)
            point = self._master.solve()
        return point

    def _priced_by(self, point: ArcMasterSolution) -> _PricedTrellis:
        """Price all arcs."""
        trellis = self._trellis.with_node(self._priced(point))
        ahead = forward(trellis)
        least = (ahead[-1] + trellis.sink).min(axis=1)
        return _PricedTrellis(trellis, ahead, point.reduced_cost_limits, float(least.sum()) - point.charge)

    def _enter_better_arcs(self, priced: _PricedTrellis) -> bool:
        """Add arcs whose best path improves the program; return whether there are any."""
        layout, objects = self._network.layout, self._network.objects
        passes = MinMarginals.of(priced.trellis, priced.forward)
        for states in (_STATES_WITH_LAYOUT if layout else _STATES, self._network.places + 1):
            arcs, costs = find_improving_arcs(priced.trellis, passes, priced.reduced_cost_limits, states)
            chosen = _cheapest_arcs(arcs.owner, costs, objects, _ARCS_WITH_LAYOUT if layout else _ARCS)
            if self._master.add_arcs(arcs.select(chosen)):
                return True
        return False

    def _priced(self, point: ArcMasterSolution) -> Floats:
        """Return the node costs with the prices of conflict rows and what moves earn."""
        network = self._network
        node = add_conflict_prices(network, self._master.rows, point.prices)
        if not network.layout:
            return node
        return add_layout_prices(node, network.locations[network.sets], point.layout_prices)


def start_arc_generation(network: Network, pricing: PathPricer, finder: ConflictSeparator) -> ArcGeneration:
    """Return a search that starts from a guess at the duals; the finder is a new one."""
    search = ArcGeneration(network, path_arcs(np.arange(network.objects), pricing.alone.nodes), [], finder)
    search.enter_guess(guess_duals(network, pricing, finder))
    return search


def _cheapest_arcs(owner: Ints, costs: Floats, objects: int, most: int) -> Bools:
    """Return which arcs are among the cheapest of their object; arcs of equal cost stay together."""
    kept = np.ones(len(owner), dtype=np.bool_)
    for n in range(objects):
        own = owner == n
        if own.sum() > most:
            kept[own] = costs[own] <= np.partition(costs[own], most)[most] + 1e-12
    return kept
