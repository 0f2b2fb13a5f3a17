"""Column generation over arcs: for windows in which many objects conflict, and for the squared layout term.

The program starts with the arcs of a few paths. The duals of violated conflict rows and of the layout are
prices on nodes. A forward and a backward Viterbi pass over the priced network give the cost of the best path
through each arc; arcs that improve the program are added. If there are none, the passes prove the optimum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.ascent.dual_ascent import DualGuess, guess_duals, usage_of_paths
from tracking.solvers.budget import RELAXATION_SHARE, BudgetMeter, Limit
from tracking.solvers.cutting_planes import ConflictRow, ConflictSeparator, conflict_prices
from tracking.solvers.objective import Ints
from tracking.solvers.programs.arc_master import (
    ArcMaster,
    ArcMasterSolution,
    ArcSet,
    find_improving_arcs,
    path_arcs,
)
from tracking.solvers.programs.linear_program import WorkLimitError
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


def add_layout_prices(node: Floats, locations: Floats, layout_prices: Floats) -> Floats:
    """Return node costs `node` (n, M, S) at `locations` (n, M, S, 4) with the layout prices.

    `layout_prices` (n, M - 1, 4) is the gain per pixel of movement.
    """
    prices = np.zeros((*node.shape[:2], BOX_SIDES))
    prices[:, 1:] -= layout_prices
    prices[:, :-1] += layout_prices
    return np.asarray(node + (locations @ prices[:, :, :, None])[:, :, :, 0])


class ArcGeneration:
    """One search from the arcs `starts` and known conflict `rows`, for at least one object; `run` it once."""

    def __init__(
        self,
        network: Network,
        starts: ArcSet,
        rows: Sequence[ConflictRow],
        finder: ConflictSeparator,
        meter: BudgetMeter,
        trellis: Trellis | None = None,
    ) -> None:
        """Prepare the search; `trellis` is that of the network, if known."""
        self._network = network
        self._meter = meter
        self._priced_points: list[tuple[ArcMasterSolution, _PricedTrellis]] = []
        """The priced point of the best bound, if there is any."""
        self._guessed = np.empty((0, 0))
        self._trellis = trellis or Trellis.of(network)
        self._finder = finder
        self._master = ArcMaster(network, meter=meter)
        # An object that is always occluded violates no row, so the program is feasible.
        occluded = np.full((network.objects, network.frames), network.max_places)
        self._master.add_arcs(path_arcs(np.arange(network.objects), occluded))
        self._master.add_arcs(starts)
        self._master.add_rows(rows)

    _tolerance = OPTIMALITY_TOLERANCE
    """Relative gap at which the optimum is proven."""

    def enter_guess(self, guess: DualGuess) -> None:
        """Add the conflict rows of a dual guess, and the arcs that improve the program at its prices."""
        self._master.add_rows(guess.rows)
        owners = np.tile(np.arange(self._network.objects), len(guess.paths))
        self._master.add_arcs(path_arcs(owners, np.concatenate(guess.paths)))
        no_limits = np.full(self._network.objects, np.inf)
        still = self._no_layout_prices()
        point = ArcMasterSolution(0.0, guess.prices, still, no_limits, float(guess.prices.sum()))
        self._guessed = mean_flow(self._network, guess.paths)
        self._add_improving_arcs(self._price(point))

    def run(self) -> RelaxedSolution:
        """Find the optimum of the relaxation, or as much as the budget allows."""
        rounds = 0
        try:
            while not (limit := self._meter.reached(RELAXATION_SHARE)):
                point = self._solve_with_violated_rows()
                rounds += 1
                priced = self._price(point)
                gap = point.objective - priced.bound
                is_optimal = gap <= self._tolerance * max(1.0, abs(point.objective))
                if is_optimal or not self._add_improving_arcs(priced):
                    return self._relaxed(point, priced, rounds, None)
        except WorkLimitError:
            limit = self._meter.reached(RELAXATION_SHARE) or "work"
        # The first prices of a search can prove less than none.
        limits = np.full(self._network.objects, np.inf)
        free = ArcMasterSolution(0.0, np.empty(0), self._no_layout_prices(), limits, 0.0)
        point, priced = max(
            ((free, self._price(free)), *self._priced_points), key=lambda found: found[1].bound
        )
        return self._relaxed(point, priced, rounds, limit)

    def _no_layout_prices(self) -> Floats:
        return np.zeros((self._network.objects, self._network.frames - 1, BOX_SIDES))

    def _relaxed(
        self, point: ArcMasterSolution, priced: _PricedTrellis, rounds: int, limit: Limit | None
    ) -> RelaxedSolution:
        rows = self._master.rows[: len(point.prices)]
        usage = self._master.usage()
        return RelaxedSolution(
            usage=usage if usage.any() or not len(self._guessed) else self._guessed,
            bound=priced.bound,
            priced=priced.trellis,
            rounds=rounds,
            prices=conflict_prices(self._network, rows, point.prices),
            limit=limit,
        )

    def _solve_with_violated_rows(self) -> ArcMasterSolution:
        """Solve the program with all conflict rows that its solution violates."""
        point = self._master.solve()
        while rows := self._finder.find_new_violated(self._master.usage()):
            self._master.add_rows(rows)
            point = self._master.solve()
        return point

    def _price(self, point: ArcMasterSolution) -> _PricedTrellis:
        """Price all nodes at a point's duals, compute the bound, and remember the best one."""
        trellis = self._trellis.with_node(self._priced_nodes(point))
        forward_costs = forward(trellis)
        costs = (forward_costs[-1] + trellis.sink).min(axis=1)
        self._meter.add_step()
        self._meter.add_passes(*self._network.node.shape)
        bound = float(costs.sum()) - point.bound_reduction
        priced = _PricedTrellis(trellis, forward_costs, point.reduced_cost_limits, bound)
        if not self._priced_points or bound > self._priced_points[0][1].bound:
            self._priced_points = [(point, priced)]
        return priced

    def _add_improving_arcs(self, priced: _PricedTrellis) -> bool:
        """Add arcs whose best path improves the program; return whether there are any."""
        layout, objects = self._network.layout, self._network.objects
        passes = MinMarginals.of(priced.trellis, priced.forward)
        self._meter.add_passes(objects, self._network.frames, self._network.max_places + 1)
        for states in (_STATES_WITH_LAYOUT if layout else _STATES, self._network.max_places + 1):
            arcs, costs = find_improving_arcs(priced.trellis, passes, priced.reduced_cost_limits, states)
            chosen = _cheapest_arcs(arcs.owner, costs, objects, _ARCS_WITH_LAYOUT if layout else _ARCS)
            if self._master.add_arcs(arcs.select(chosen)):
                return True
        return False

    def _priced_nodes(self, point: ArcMasterSolution) -> Floats:
        """Return the node costs with the prices of conflict rows and of the layout."""
        network = self._network
        node = add_conflict_prices(network, self._master.rows[: len(point.prices)], point.prices)
        if not network.layout:
            return node
        return add_layout_prices(node, network.locations[network.sets], point.layout_prices)


def generate_arcs(
    network: Network, pricing: PathPricer, finder: ConflictSeparator, meter: BudgetMeter
) -> RelaxedSolution:
    """Find the optimum of the relaxation, from a guess at the duals; the finder must be unused."""
    starts = path_arcs(np.arange(network.objects), pricing.alone.nodes)
    search = ArcGeneration(network, starts, [], finder, meter, pricing.trellis)
    search.enter_guess(guess_duals(network, pricing, finder, meter))
    return search.run()


def mean_flow(network: Network, paths: Ints) -> Floats:
    """Return the mean flow y (n, M, S) of paths (G, n, M); an ascent's last ones approximate the optimum."""
    return np.asarray(np.mean([usage_of_paths(network, nodes) for nodes in paths], axis=0))


def _cheapest_arcs(owner: Ints, costs: Floats, objects: int, limit: int) -> Bools:
    """Return which arcs are among the cheapest of their object; arcs of equal cost stay together."""
    kept = np.ones(len(owner), dtype=np.bool_)
    for n in range(objects):
        own = owner == n
        if own.sum() > limit:
            kept[own] = costs[own] <= np.partition(costs[own], limit)[limit] + 1e-12
    return kept
