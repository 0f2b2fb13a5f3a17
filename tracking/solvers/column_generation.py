"""Column generation over whole paths, for windows without layout term.

Every object starts on its cheapest path. Objects whose paths conflict enter a small program that combines
their paths so that the violated rows hold. Its duals are prices on the places of the rows; a Viterbi pass
over the priced network finds each object's best path or proves that there is no better one. Objects that
never conflict share no row, so the program splits into independent groups. Most objects of most windows never
enter it.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.arc_generation import ArcGeneration, generate_arcs
from tracking.solvers.ascent.layout_ascent import LayoutAscent
from tracking.solvers.base import Solution, TimedSolver
from tracking.solvers.budget import RELAXATION_SHARE, BudgetMeter, Limit
from tracking.solvers.cutting_planes import ConflictRow, ConflictSeparator, conflict_prices, group_objects
from tracking.solvers.dynamic_programming import greedy_paths
from tracking.solvers.heuristics.local_search import LocalSearch
from tracking.solvers.hidden_paths import allow_hiding
from tracking.solvers.objective import Ints, conflict_count, path_costs
from tracking.solvers.programs.arc_master import path_arcs
from tracking.solvers.programs.linear_program import WorkLimitError
from tracking.solvers.programs.path_master import PathMaster, PathMasterSolution
from tracking.solvers.relaxation import (
    OPTIMALITY_TOLERANCE,
    RelaxedSolution,
    try_warm_start,
)
from tracking.solvers.solution_builder import empty_solution, solution_from_relaxation
from tracking.solvers.viterbi import PathPricer, Paths, Trellis
from tracking.solvers.warm_start import WarmStart

_MAX_PATH_GROUP = 8
"""Largest group of conflicting objects for which columns of paths converge faster than arcs."""

_SUBGRADIENT_STEPS, _STEP_FACTOR = 8, 1.2
"""Subgradient steps per round, and their length relative to Polyak's.
"""

_MIN_STEPS, _MAX_GAP_RATIO = 2, 0.8
"""Steps before the round may stop early, and the gap per step, relative to the one before, at which it
does."""

_MAX_ROUNDS_SMALL_GROUP, _MAX_ROUNDS_LARGE_GROUP = 50, 4
"""Rounds with paths as columns before switching to arcs."""


class PathGeneration:
    """One search; `run` it once. The network has at least one object and no layout term."""

    def __init__(self, network: Network, meter: BudgetMeter) -> None:
        self._network = network
        self._meter = meter
        self._pricing = PathPricer(Trellis.of(network))
        self._meter.add_passes(*network.node.shape)
        self._alone = self._pricing.alone
        self._bound = -np.inf
        self._rounds = 0
        self._priced = self._pricing.trellis
        self._prices = np.empty(0)
        self._point = PathMasterSolution(0.0, np.empty(0), np.empty(0))
        self._linked = np.zeros((network.objects, network.objects), dtype=np.bool_)
        self._active = np.zeros(network.objects, dtype=np.bool_)
        self._usage = np.zeros(network.node.shape)
        each, frames = np.indices(self._alone.nodes.shape)
        self._usage[each, frames, self._alone.nodes] = 1.0

    def run(self, warm_start: WarmStart | None = None) -> RelaxedSolution:
        """Find the optimum of the relaxation."""
        if not conflict_count(self._network, self._alone.nodes):
            return RelaxedSolution(self._usage, float(self._alone.costs.sum()), self._priced, 0)
        self._bound = float(self._alone.costs.sum())
        try:
            return self._resolve_conflicts(warm_start)
        except WorkLimitError:
            return self._stopped(self._meter.reached(RELAXATION_SHARE) or "work")

    def _stopped(self, limit: Limit) -> RelaxedSolution:
        """Return what is known: the last flow, and the best bound."""
        return RelaxedSolution(self._usage, self._bound, self._priced, self._rounds, limit=limit)

    def _resolve_conflicts(self, warm_start: WarmStart | None) -> RelaxedSolution:
        rows = self._finder.find_new_violated(self._usage)
        warm = try_warm_start(self._network, self._pricing, self._finder, warm_start) if warm_start else None
        if warm is not None and warm.proven is not None:
            return warm.proven
        self._link_objects(rows)
        if self._largest_group() > _MAX_PATH_GROUP:
            finder = ConflictSeparator(self._network)
            return generate_arcs(self._network, self._pricing, finder, self._meter)
        self._add_rows([*rows, *self._finder.take_new(warm.rows)] if warm else rows)
        for paths in warm.paths if warm else ():
            active = np.flatnonzero(self._active)
            self._master.add_paths(active, paths.select(active))
        self._solve()
        self._add_violated_rows()
        while self._rounds < (
            _MAX_ROUNDS_SMALL_GROUP if self._largest_group() <= _MAX_PATH_GROUP else _MAX_ROUNDS_LARGE_GROUP
        ):
            if limit := self._meter.reached(RELAXATION_SHARE):
                return self._stopped(limit)
            self._rounds += 1
            if not self._add_improving_paths():
                rows = self._master.rows[: len(self._prices)]
                prices = conflict_prices(self._network, rows, self._prices)
                return RelaxedSolution(self._usage, self._bound, self._priced, self._rounds, prices)
            self._solve()
            self._add_violated_rows()
        return self._switch_to_arcs(self._rounds)

    @cached_property
    def _finder(self) -> ConflictSeparator:
        return ConflictSeparator(self._network)

    @cached_property
    def _master(self) -> PathMaster:
        return PathMaster(self._network, self._meter)

    def _switch_to_arcs(self, rounds: int) -> RelaxedSolution:
        """Continue with arcs, from those of the paths in use: large groups need parts of paths combined."""
        owners, nodes = self._master.used_paths()
        inactive = np.flatnonzero(~self._active)
        starts = path_arcs(
            np.concatenate([owners, inactive]), np.concatenate([nodes, self._alone.nodes[inactive]])
        )
        search = ArcGeneration(
            self._network, starts, self._master.rows, self._finder, self._meter, self._pricing.trellis
        )
        found = search.run()
        if found.bound < self._bound:
            prices = conflict_prices(self._network, self._master.rows[: len(self._prices)], self._prices)
            found = replace(found, bound=self._bound, priced=self._priced, prices=prices)
        return replace(found, rounds=found.rounds + rounds)

    def _solve(self) -> None:
        self._point = self._master.solve()
        self._master.write_usage(self._usage)

    def _add_violated_rows(self) -> None:
        """Add violated rows and solve until none is violated."""
        while rows := self._finder.find_new_violated(self._usage):
            self._add_rows(rows)
            self._solve()

    def _link_objects(self, rows: list[ConflictRow]) -> Bools:
        """Link the objects that share a row; return which objects are on any row, (n,)."""
        concerned = np.zeros(self._network.objects, dtype=np.bool_)
        for row in rows:
            members = np.asarray((self._usage[:, row.frame] * row.members).any(axis=1))
            self._linked |= np.outer(members, members)
            concerned |= members
        return concerned

    def _largest_group(self) -> int:
        """Return the size of the largest group of objects linked directly or through others."""
        return int(np.bincount(group_objects(self._linked)).max())

    def _add_rows(self, rows: list[ConflictRow]) -> None:
        """Add the objects that violate rows, and paths that avoid all rows, to the program."""
        concerned = self._link_objects(rows)
        new = np.flatnonzero(concerned & ~self._active)
        self._active[new] = True
        if len(new):
            self._master.add_objects(new.tolist())
        self._master.add_rows(rows)
        # An object that is always occluded violates no row, so the program is feasible.
        occluded = np.full((self._network.objects, self._network.frames), self._network.max_places)
        self._master.add_paths(new, Paths(occluded, path_costs(self._network, occluded)).select(new))
        self._master.add_paths(new, self._alone.select(new))
        self._add_detours(np.flatnonzero(concerned))

    def _add_detours(self, objects: Ints) -> None:
        """Add for each of the objects the best path that avoids all rows."""
        in_rows = self._master.members.add_prices(
            np.zeros_like(self._network.node), np.ones(len(self._master.rows))
        )
        node = np.where(in_rows > 0.0, np.inf, self._network.node)
        self._master.add_paths(objects, self._pricing.best_paths(node, objects))

    def _add_improving_paths(self) -> bool:
        """Price all paths and add the improving ones; return whether there are any. Updates the bound.

        If objects conflict in several consecutive frames, the program's duals put a price on only one of
        them, and each of the others would take a round. So the prices take a few of Polyak's subgradient
        steps from there, with the program's cost as the target.
        """
        active, prices = np.flatnonzero(self._active), self._point.prices
        inactive_cost = float(self._alone.costs[~self._active].sum())
        cost = inactive_cost + self._point.objective
        found: list[Ints] = []
        gaps: list[float] = []
        for step in range(_SUBGRADIENT_STEPS):
            priced = self._master.members.add_prices(self._network.node, prices)
            paths = self._pricing.best_paths(priced, active)
            self._meter.add_step()
            self._meter.add_passes(len(active), *self._network.node.shape[1:])
            bound = inactive_cost + float(paths.costs.sum() - prices.sum())
            if bound >= self._bound:
                self._bound, self._prices = bound, prices
                self._priced = self._pricing.trellis.with_node(priced)
            gaps.append(cost - bound)
            if gaps[-1] <= OPTIMALITY_TOLERANCE * max(1.0, abs(cost)):
                return False
            found.append(paths.nodes)
            if step >= _MIN_STEPS and gaps[-1] > _MAX_GAP_RATIO**step * gaps[0]:
                break
            slope = self._master.members.of_paths(active, paths.nodes).sum(axis=0) - 1.0
            slope[(slope < 0.0) & (prices == 0.0)] = 0.0
            if not slope.any():
                break
            prices = np.maximum(0.0, prices + _STEP_FACTOR * gaps[-1] / float(slope @ slope) * slope)
        return sum([self._add_paths(active, nodes) for nodes in found]) > 0

    def _add_paths(self, objects: Ints, nodes: Ints) -> int:
        """Add paths of objects; return how many are new."""
        all_nodes = self._alone.nodes.copy()
        all_nodes[objects] = nodes
        return self._master.add_paths(objects, Paths(nodes, path_costs(self._network, all_nodes)[objects]))


class ColumnGenerationSolver(TimedSolver):
    """Column generation: the same optimum as `arcs`, many times faster."""

    name = "columns"

    def _solve(self, network: Network, warm_start: WarmStart | None, meter: BudgetMeter) -> Solution:
        """Solve the relaxation, and round it if it is not integral."""
        if not network.objects:
            return empty_solution(self.name, network)
        found = solve_relaxation(network, warm_start, meter)
        return solution_from_relaxation(self.name, network, found, meter, warm_start=warm_start)


def solve_relaxation(
    network: Network, warm_start: WarmStart | None = None, meter: BudgetMeter | None = None
) -> RelaxedSolution:
    """Return the optimum of a relaxation of a network with at least one object.

    If only conflicts couple the objects, it is that of the program in II.D, by columns of paths. With a
    layout term it is near the optimum of a tighter one, by dual ascent.
    """
    network, meter = allow_hiding(network), meter or BudgetMeter()
    if not network.layout or min(network.objects, network.frames) < 2:  # noqa: PLR2004 — nothing moves apart
        return PathGeneration(network, meter).run(warm_start)
    return LayoutAscent(network, ConflictSeparator(network), meter).run()


_SQUARED_POWER = 2


class SquaredLayoutSolver(TimedSolver):
    """Like `columns`, but a layout change of d pixels costs μ d², which favors small changes over jumps.

    Without layout term or with a single object it equals `columns`.
    """

    name = "l2"

    def _solve(self, network: Network, warm_start: WarmStart | None, meter: BudgetMeter) -> Solution:
        """Solve the relaxation, and round it if it is not integral."""
        if not network.objects:
            return empty_solution(self.name, network)
        if not network.layout:
            return solution_from_relaxation(self.name, network, solve_relaxation(network, meter=meter), meter)
        solvable = allow_hiding(network)
        start = LocalSearch(solvable, _SQUARED_POWER, meter).improve(greedy_paths(solvable).nodes)
        starts = path_arcs(np.arange(network.objects), start)
        found = _SquaredLayoutGeneration(solvable, starts, [], ConflictSeparator(network), meter).run()
        return solution_from_relaxation(self.name, network, found, meter, _SQUARED_POWER, warm_start)


class _SquaredLayoutGeneration(ArcGeneration):
    """The same search with the quadratic program, whose duals are less exact than a simplex method's."""

    _tolerance = 1e-8
