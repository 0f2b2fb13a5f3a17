"""Column generation over arcs: for the layout term, and for windows in which many objects conflict.

The program starts with the arcs of a few paths. The duals of violated conflict rows and of the layout are
prices on nodes. A forward and a backward Viterbi pass over the priced network give the cost of the best path
through each arc; arcs that improve the program are added. If there are none, the passes prove the optimum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.cutting_planes import ConflictRow, ConflictSeparator, conflict_prices
from tracking.solvers.dual_ascent import DualGuess, add_layout_prices, guess_duals
from tracking.solvers.objective import Ints
from tracking.solvers.programs.arc_master import (
    ArcMaster,
    ArcMasterSolution,
    ArcSet,
    find_improving_arcs,
    path_arcs,
)
from tracking.solvers.relaxation import OPTIMALITY_TOLERANCE, RelaxedSolution, add_conflict_prices
from tracking.solvers.viterbi import MinMarginals, PathPricer, Trellis, forward

_ARCS_WITH_LAYOUT, _ARCS = 300, 100
"""Most arcs added per object and round, about those of a few paths; more only enlarge the program."""

_STATES_WITH_LAYOUT, _STATES = 12, 6
"""Cheapest states per frame and object whose arcs are tried first: most rounds need no others."""


@dataclass(frozen=True, slots=True, eq=False)
class _PricedTrellis:
    """The trellis with prices, the forward pass over it, and the bound that it proves."""

    trellis: Trellis
    forward: Floats
    reduced_cost_limits: Floats
    bound: float


class ArcGeneration:
    """One search from the arcs `starts` and known conflict `rows`, for at least one object; `run` it once."""

    def __init__(
        self, network: Network, starts: ArcSet, rows: Sequence[ConflictRow], finder: ConflictSeparator
    ) -> None:
        self._network = network
        self._trellis = Trellis.of(network)
        self._finder = finder
        self._master = self._new_master()
        # An object that is always occluded violates no row, so the program is feasible.
        occluded = np.full((network.objects, network.frames), network.max_places)
        self._master.add_arcs(path_arcs(np.arange(network.objects), occluded))
        self._master.add_arcs(starts)
        self._master.add_rows(rows)

    _tolerance = OPTIMALITY_TOLERANCE
    """Relative gap at which the optimum is proven."""

    def _new_master(self) -> ArcMaster:
        return ArcMaster(self._network)

    def enter_guess(self, guess: DualGuess) -> None:
        """Add the conflict rows of a dual guess, and the arcs that improve the program at its prices."""
        self._master.add_rows(guess.rows)
        owners = np.tile(np.arange(self._network.objects), len(guess.paths))
        self._master.add_arcs(path_arcs(owners, np.concatenate(guess.paths)))
        no_limits = np.full(self._network.objects, np.inf)
        self._add_improving_arcs(
            self._price(ArcMasterSolution(0.0, guess.prices, guess.layout_prices, no_limits, 0.0))
        )

    def run(self) -> RelaxedSolution:
        """Find the optimum of the relaxation."""
        rounds = 0
        while True:
            point = self._solve_with_violated_rows()
            rounds += 1
            priced = self._price(point)
            gap = point.objective - priced.bound
            if gap <= self._tolerance * max(1.0, abs(point.objective)) or not self._add_improving_arcs(
                priced
            ):
                return self._relaxed(point, priced, rounds)

    def _relaxed(self, point: ArcMasterSolution, priced: _PricedTrellis, rounds: int) -> RelaxedSolution:
        bound_reductions = np.zeros(self._network.frames)
        frames = np.array([row.frame for row in self._master.rows], dtype=np.int64)
        np.add.at(bound_reductions, frames, point.prices)
        return RelaxedSolution(
            usage=self._master.usage(),
            bound=priced.bound,
            priced=priced.trellis.node,
            rounds=rounds,
            prices=conflict_prices(self._network, self._master.rows, point.prices),
            layout_prices=point.layout_prices,
            bound_reductions=bound_reductions,
        )

    def _solve_with_violated_rows(self) -> ArcMasterSolution:
        """Solve the program with all conflict rows that its solution violates."""
        point = self._master.solve()
        while rows := self._finder.find_new_violated(self._master.usage()):
            self._master.add_rows(rows)
            point = self._master.solve()
        return point

    def _price(self, point: ArcMasterSolution) -> _PricedTrellis:
        """Price all nodes at a point's duals, and compute the bound."""
        trellis = self._trellis.with_node(self._priced_nodes(point))
        forward_costs = forward(trellis)
        costs = (forward_costs[-1] + trellis.sink).min(axis=1)
        return _PricedTrellis(
            trellis, forward_costs, point.reduced_cost_limits, float(costs.sum()) - point.bound_reduction
        )

    def _add_improving_arcs(self, priced: _PricedTrellis) -> bool:
        """Add arcs whose best path improves the program; return whether there are any."""
        layout, objects = self._network.layout, self._network.objects
        passes = MinMarginals.of(priced.trellis, priced.forward)
        for states in (_STATES_WITH_LAYOUT if layout else _STATES, self._network.max_places + 1):
            arcs, costs = find_improving_arcs(priced.trellis, passes, priced.reduced_cost_limits, states)
            chosen = _cheapest_arcs(arcs.owner, costs, objects, _ARCS_WITH_LAYOUT if layout else _ARCS)
            if self._master.add_arcs(arcs.select(chosen)):
                return True
        return False

    def _priced_nodes(self, point: ArcMasterSolution) -> Floats:
        """Return the node costs with the prices of conflict rows and of the layout."""
        network = self._network
        node = add_conflict_prices(network, self._master.rows, point.prices)
        if not network.layout:
            return node
        return add_layout_prices(node, network.locations[network.sets], point.layout_prices)


def start_arc_generation(network: Network, pricing: PathPricer, finder: ConflictSeparator) -> ArcGeneration:
    """Return a search that starts from a guess at the duals; the finder must be unused."""
    search = ArcGeneration(network, path_arcs(np.arange(network.objects), pricing.alone.nodes), [], finder)
    search.enter_guess(guess_duals(network, pricing, finder))
    return search


def _cheapest_arcs(owner: Ints, costs: Floats, objects: int, limit: int) -> Bools:
    """Return which arcs are among the cheapest of their object; arcs of equal cost stay together."""
    kept = np.ones(len(owner), dtype=np.bool_)
    for n in range(objects):
        own = owner == n
        if own.sum() > limit:
            kept[own] = costs[own] <= np.partition(costs[own], limit)[limit] + 1e-12
    return kept
