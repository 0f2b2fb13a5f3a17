"""Column generation over whole paths, for windows without layout term.

Every object starts on its cheapest path. Where these conflict, the objects concerned, and no others,
enter a small program that mixes their paths so that the rows they broke hold. Its duals price the places
of the rows; a Viterbi pass over the priced network finds each object's best path or proves that there is
no better one. Objects that never meet never share a row, so the program falls into independent groups
of objects, and a group whose prices stand still is not priced again; most objects of most windows never
enter it.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.arc_generation import ArcGeneration, start_arc_generation
from tracking.solvers.arc_master import ArcMaster, path_arcs
from tracking.solvers.base import Solution, TimedSolver
from tracking.solvers.cutting_planes import ConflictRow, ConflictSeparator, conflict_prices, group_objects
from tracking.solvers.dynamic_programming import greedy_paths
from tracking.solvers.objective import Ints, conflict_count, path_costs
from tracking.solvers.path_master import PathMaster, PathMasterSolution
from tracking.solvers.relaxation import (
    OPTIMALITY_TOLERANCE,
    RelaxedSolution,
    add_conflict_prices,
    try_warm_start,
)
from tracking.solvers.rounding import LocalSearch
from tracking.solvers.solution_builder import empty_solution, solution_from_relaxation
from tracking.solvers.viterbi import PathPricer, Paths, Trellis
from tracking.solvers.warm_start import WarmStart

_MAX_PATH_GROUP = 12
"""Up to so many objects in conflict, paths settle sooner than arcs do."""

_SUBGRADIENT_STEPS, _STEP_FACTOR = 8, 1.2
"""Steps of prices in each round, and how much longer than Polyak's they are: into the optimum, not onto
its edge.
"""

_PATIENCE, _MIN_PROGRESS = 2, 0.8
"""After so many steps, those that leave more than this share of what is missing, each, are given up."""

_MAX_ROUNDS_SMALL_GROUP, _MAX_ROUNDS_LARGE_GROUP = 50, 4
"""Rounds of paths before arcs take over."""


class PathGeneration:
    """One search; `run` it once. The network has at least one object and no layout term."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._pricing = PathPricer(Trellis.of(network))
        self._alone = self._pricing.alone
        self._bound = -np.inf
        self._priced = network.node
        self._prices = np.empty(0)
        self._point = PathMasterSolution(0.0, np.empty(0), np.empty(0))
        self._meets = np.zeros((network.objects, network.objects), dtype=np.bool_)
        self._active = np.zeros(network.objects, dtype=np.bool_)
        self._usage = np.zeros(network.node.shape)
        each, frames = np.indices(self._alone.nodes.shape)
        self._usage[each, frames, self._alone.nodes] = 1.0

    def run(self, warm_start: WarmStart | None = None) -> RelaxedSolution:
        """Find the optimum of the relaxation."""
        if not conflict_count(self._network, self._alone.nodes):
            return RelaxedSolution(self._usage, float(self._alone.costs.sum()), self._priced, 0)
        return self._of_those_who_meet(warm_start)

    def _of_those_who_meet(self, warm_start: WarmStart | None) -> RelaxedSolution:
        rows = self._finder.find_violated(self._usage)
        told = try_warm_start(self._network, self._pricing, self._finder, warm_start) if warm_start else None
        if told is not None and told.proven is not None:
            return told.proven
        self._meet(rows)
        if self._largest_group() > _MAX_PATH_GROUP:
            return start_arc_generation(self._network, self._pricing, ConflictSeparator(self._network)).run()
        self._bind([*rows, *self._finder.drop_known(told.rows)] if told else rows)
        for paths in told.paths if told else ():
            active = np.flatnonzero(self._active)
            self._master.add_paths(active, paths.select(active))
        self._solve()
        self._keep_rows()
        rounds = 0
        while rounds < (
            _MAX_ROUNDS_SMALL_GROUP if self._largest_group() <= _MAX_PATH_GROUP else _MAX_ROUNDS_LARGE_GROUP
        ):
            rounds += 1
            if not self._enter_better_paths():
                prices = conflict_prices(self._network, self._master.rows, self._prices)
                return RelaxedSolution(self._usage, self._bound, self._priced, rounds, prices)
            self._solve()
            self._keep_rows()
        return self._by_arcs(rounds)

    @cached_property
    def _finder(self) -> ConflictSeparator:
        return ConflictSeparator(self._network)

    @cached_property
    def _master(self) -> PathMaster:
        return PathMaster(self._network)

    def _by_arcs(self, rounds: int) -> RelaxedSolution:
        """Go on from the arcs of the paths in use: many objects that meet want parts of paths combined."""
        owners, nodes = self._master.used_paths()
        calm = np.flatnonzero(~self._active)
        starts = path_arcs(np.concatenate([owners, calm]), np.concatenate([nodes, self._alone.nodes[calm]]))
        found = ArcGeneration(self._network, starts, self._master.rows, self._finder).run()
        return RelaxedSolution(found.usage, found.bound, found.priced, found.rounds + rounds)

    def _solve(self) -> None:
        self._point = self._master.solve()
        self._master.write_usage(self._usage)

    def _keep_rows(self) -> None:
        """Bind the program by the rows it breaks until it breaks none."""
        while rows := self._finder.find_violated(self._usage):
            self._bind(rows)
            self._solve()

    def _meet(self, rows: list[ConflictRow]) -> Bools:
        """Note who meets whom on the rows; say which objects are on any, (n,)."""
        concerned = np.zeros(self._network.objects, dtype=np.bool_)
        for row in rows:
            there = np.asarray((self._usage[:, row.frame] * row.members).any(axis=1))
            self._meets |= np.outer(there, there)
            concerned |= there
        return concerned

    def _largest_group(self) -> int:
        """Return the size of the largest group of objects that meet, directly or through others."""
        return int(np.bincount(group_objects(self._meets)).max())

    def _bind(self, rows: list[ConflictRow]) -> None:
        """Add the objects that violate rows, and paths that avoid all rows, to the program."""
        concerned = self._meet(rows)
        new = np.flatnonzero(concerned & ~self._active)
        self._active[new] = True
        if len(new):
            self._master.add_objects(new.tolist())
        self._master.add_rows(rows)
        # Occluded all along, an object keeps every row: the program always has a solution.
        hidden = np.full((self._network.objects, self._network.frames), self._network.places)
        self._master.add_paths(new, Paths(hidden, path_costs(self._network, hidden)).select(new))
        self._master.add_paths(new, self._alone.select(new))
        self._enter_detours(np.flatnonzero(concerned))

    def _enter_detours(self, objects: Ints) -> None:
        """Add for each of the objects the best path that avoids all rows."""
        node = self._network.node.copy()
        for row in self._master.rows:
            node[:, row.frame][row.members] = np.inf
        self._master.add_paths(objects, self._pricing.best_paths(node, objects))

    def _enter_better_paths(self) -> bool:
        """Price all paths; let the better ones in; say whether there are any. Keeps the bound.

        Where objects meet for some frames on end, the program's duals charge for one of the frames, and
        a round would go by for each of the others. So prices take some steps of their own from there,
        up to the cost that the program has attained: Polyak's subgradient steps.
        """
        active, prices = np.flatnonzero(self._active), self._point.prices
        others = float(self._alone.costs[~self._active].sum())
        cost = others + self._point.objective
        met: list[Ints] = []
        missing: list[float] = []
        for step in range(_SUBGRADIENT_STEPS):
            self._priced = add_conflict_prices(self._network, self._master.rows, prices)
            self._prices = prices
            paths = self._pricing.best_paths(self._priced, active)
            self._bound = others + float(paths.costs.sum() - prices.sum())
            missing.append(cost - self._bound)
            if missing[-1] <= OPTIMALITY_TOLERANCE * max(1.0, abs(cost)):
                return False
            met.append(paths.nodes)
            if step >= _PATIENCE and missing[-1] > _MIN_PROGRESS**step * missing[0]:
                break
            loads = [row.members[active, paths.nodes[:, row.frame]].sum() for row in self._master.rows]
            slope = np.array(loads) - 1.0
            slope[(slope < 0.0) & (prices == 0.0)] = 0.0
            if not slope.any():
                break
            prices = np.maximum(0.0, prices + _STEP_FACTOR * missing[-1] / float(slope @ slope) * slope)
        return sum([self._enter(active, nodes) for nodes in met]) > 0

    def _enter(self, objects: Ints, nodes: Ints) -> int:
        """Add paths of objects; return how many are new."""
        every = self._alone.nodes.copy()
        every[objects] = nodes
        return self._master.add_paths(objects, Paths(nodes, path_costs(self._network, every)[objects]))


class ColumnGenerationSolver(TimedSolver):
    """The optimum of the relaxation from a few of its columns; equal to `arcs`, and many times faster."""

    name = "columns"

    def _solve(self, network: Network, warm_start: WarmStart | None) -> Solution:
        """Solve the relaxation and round it where it is not whole."""
        if not network.objects:
            return empty_solution(self.name, network)
        return solution_from_relaxation(self.name, network, solve_relaxation(network, warm_start))


def solve_relaxation(network: Network, warm_start: WarmStart | None = None) -> RelaxedSolution:
    """Return the optimum of the relaxation of a network with at least one object.

    Paths are the columns where only conflicts couple the objects; under the layout term, which whole
    paths fit badly, arcs are.
    """
    if not network.layout:
        return PathGeneration(network).run(warm_start)
    return start_arc_generation(network, PathPricer(Trellis.of(network)), ConflictSeparator(network)).run()


_SQUARED_POWER = 2


class SquaredLayoutSolver(TimedSolver):
    """As `columns`, but a change of layout by d pixels costs μ d²: many small changes rather than a jump.

    Without layout term or a second object it is `columns`.
    """

    name = "l2"

    def _solve(self, network: Network, _warm_start: WarmStart | None) -> Solution:
        """Solve the relaxation and round it where it is not whole."""
        if not network.objects:
            return empty_solution(self.name, network)
        if not network.layout:
            return solution_from_relaxation(self.name, network, solve_relaxation(network))
        start = LocalSearch(network, _SQUARED_POWER).improve(greedy_paths(network).nodes)
        starts = path_arcs(np.arange(network.objects), start)
        found = _SquaredLayoutGeneration(network, starts, [], ConflictSeparator(network)).run()
        return solution_from_relaxation(self.name, network, found, _SQUARED_POWER)


class _SquaredLayoutGeneration(ArcGeneration):
    """The same search with the quadratic program."""

    def _new_master(self) -> ArcMaster:
        return ArcMaster(self._network, squared=True)
