"""Column generation over arcs: for the layout term, and for windows in which many objects conflict.

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
from tracking.solvers.budget import RELAXATION_SHARE, BudgetMeter, Limit
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
from tracking.solvers.programs.linear_program import WorkLimitError
from tracking.solvers.relaxation import OPTIMALITY_TOLERANCE, RelaxedSolution, add_conflict_prices
from tracking.solvers.viterbi import MinMarginals, PathPricer, Trellis, best_paths, forward

_ARCS_WITH_LAYOUT, _ARCS = 300, 100
"""Most arcs added per object and round, about those of a few paths; more only enlarge the program."""

_ENTRIES_PER_ROW = 5
"""Entries of a row of the layout term, at least."""

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
        self,
        network: Network,
        starts: ArcSet,
        rows: Sequence[ConflictRow],
        finder: ConflictSeparator,
        meter: BudgetMeter,
    ) -> None:
        self._network = network
        self._meter = meter
        self._priced_points: list[tuple[ArcMasterSolution, _PricedTrellis]] = []
        """The priced point of the best bound, if there is any."""
        self._guessed = np.empty((0, 0))
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
        return ArcMaster(self._network, meter=self._meter)

    def enter_guess(self, guess: DualGuess) -> None:
        """Add the conflict rows of a dual guess, and the arcs that improve the program at its prices."""
        self._master.add_rows(guess.rows)
        owners = np.tile(np.arange(self._network.objects), len(guess.paths))
        self._master.add_arcs(path_arcs(owners, np.concatenate(guess.paths)))
        no_limits = np.full(self._network.objects, np.inf)
        point = ArcMasterSolution(
            0.0, guess.prices, guess.layout_prices, no_limits, float(guess.prices.sum())
        )
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
        network = self._network
        layout_prices = np.zeros((network.objects, network.frames - 1, BOX_SIDES))
        free = ArcMasterSolution(0.0, np.empty(0), layout_prices, np.full(network.objects, np.inf), 0.0)
        point, priced = max(
            ((free, self._price(free)), *self._priced_points), key=lambda found: found[1].bound
        )
        return self._relaxed(point, priced, rounds, limit)

    def _relaxed(
        self, point: ArcMasterSolution, priced: _PricedTrellis, rounds: int, limit: Limit | None
    ) -> RelaxedSolution:
        rows = self._master.rows[: len(point.prices)]
        bound_reductions = np.zeros(self._network.frames)
        frames = np.array([row.frame for row in rows], dtype=np.int64)
        np.add.at(bound_reductions, frames, point.prices)
        usage = self._master.usage()
        return RelaxedSolution(
            usage=usage if usage.any() or not len(self._guessed) else self._guessed,
            bound=priced.bound,
            priced=priced.trellis.node,
            rounds=rounds,
            prices=conflict_prices(self._network, rows, point.prices),
            layout_prices=point.layout_prices,
            bound_reductions=bound_reductions,
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
    """Find the optimum of the relaxation, from a guess at the duals; the finder must be unused.

    Where the budget does not allow even one program, the guess takes its place.
    """
    if not _allows_a_program(network, meter):
        return relaxed_by_ascent(network, guess_duals(network, pricing, finder, meter, is_last=True), meter)
    starts = path_arcs(np.arange(network.objects), pricing.alone.nodes)
    search = ArcGeneration(network, starts, [], finder, meter)
    search.enter_guess(guess_duals(network, pricing, finder, meter))
    return search.run()


def _allows_a_program(network: Network, meter: BudgetMeter) -> bool:
    """Return whether the budget allows a simplex iteration for each row of the layout term."""
    if not network.layout:
        return True
    pairs = network.objects * (network.objects - 1) // 2
    rows = (network.objects + pairs) * (network.frames - 1) * BOX_SIDES
    least = BudgetMeter()
    least.add_iterations(rows, _ENTRIES_PER_ROW * rows)
    return least.work_s <= meter.left(RELAXATION_SHARE)


def relaxed_by_ascent(network: Network, guess: DualGuess, meter: BudgetMeter) -> RelaxedSolution:
    """Return the bound of a guess at the duals, and the mean of its last paths as the flow."""
    node = add_conflict_prices(network, guess.rows, guess.prices)
    if network.layout:
        node = add_layout_prices(node, network.locations[network.sets], guess.layout_prices)
    paths, free = best_paths(Trellis.of(network).with_node(node)), best_paths(Trellis.of(network))
    for _ in range(2):
        meter.add_passes(*network.node.shape)
    bound = float(paths.costs.sum() - guess.prices.sum())
    alone = float(free.costs.sum())
    return RelaxedSolution(
        usage=mean_flow(network, guess.paths),
        bound=max(bound, alone),
        priced=node if bound >= alone else network.node,
        rounds=0,
        limit=meter.reached(RELAXATION_SHARE) or "work",
    )


def mean_flow(network: Network, paths: Ints) -> Floats:
    """Return the mean flow y (n, M, S) of paths (G, n, M); an ascent's last ones approximate the optimum."""
    each, frames = np.indices(paths.shape[1:])
    usage = np.zeros(network.node.shape)
    for nodes in paths:
        usage[each, frames, nodes] += 1.0 / len(paths)
    return usage


def _cheapest_arcs(owner: Ints, costs: Floats, objects: int, limit: int) -> Bools:
    """Return which arcs are among the cheapest of their object; arcs of equal cost stay together."""
    kept = np.ones(len(owner), dtype=np.bool_)
    for n in range(objects):
        own = owner == n
        if own.sum() > limit:
            kept[own] = costs[own] <= np.partition(costs[own], limit)[limit] + 1e-12
    return kept
