"""The relaxation with arcs as columns, restricted to the arcs added so far, in any combination."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.budget import BudgetMeter
from tracking.solvers.cutting_planes import ConflictRow, RowMembers
from tracking.solvers.objective import Ints
from tracking.solvers.programs.layout_rows import LayoutConstraints
from tracking.solvers.programs.linear_program import LinearSolution, create_highs, run_highs
from tracking.solvers.viterbi import MinMarginals, PrunedStates, Trellis

_NO_ROW = -1


@dataclass(frozen=True, slots=True, eq=False)
class ArcSet:
    """Arcs to state `target` of `frame` from state `origin` of the frame before, in frame 0 the source.

    Attributes:
        owner: (A,) the object.
        frame: (A,) the frame of the target.
        origin: (A,) the state it leaves; 0 for the source.
        target: (A,) the state it enters.
    """

    owner: Ints
    frame: Ints
    origin: Ints
    target: Ints

    def __len__(self) -> int:
        return len(self.owner)

    def select(self, chosen: Bools) -> ArcSet:
        """Return some of the arcs."""
        return ArcSet(self.owner[chosen], self.frame[chosen], self.origin[chosen], self.target[chosen])

    def concatenate(self, more: ArcSet) -> ArcSet:
        """Return the union with more arcs."""
        return ArcSet(
            np.concatenate([self.owner, more.owner]),
            np.concatenate([self.frame, more.frame]),
            np.concatenate([self.origin, more.origin]),
            np.concatenate([self.target, more.target]),
        )


def path_arcs(owners: Ints, nodes: Ints) -> ArcSet:
    """Return the distinct arcs of paths `nodes` (P, M) of the objects `owners` (P,)."""
    before = np.zeros_like(nodes)
    before[:, 1:] = nodes[:, :-1]
    shape = (int(owners.max(initial=0)) + 1, nodes.shape[1], *[int(nodes.max(initial=0)) + 1] * 2)
    frames = np.arange(nodes.shape[1])
    once = np.unique(np.ravel_multi_index((owners[:, None], frames, before, nodes), shape))
    return ArcSet(*np.unravel_index(once, shape))


@dataclass(frozen=True, slots=True, eq=False)
class ArcMasterSolution:
    """The optimum of a restricted program.

    Attributes:
        objective: its cost.
        prices: (R,) the price of each conflict row, not negative.
        layout_prices: (n, M - 1, 4) the gain per pixel of movement by the layout term.
        reduced_cost_limits: (n,) the cost below which a path of an object improves the program.
        bound_reduction: the amount by which prices and layout term reduce the bound.
    """

    objective: float
    prices: Floats
    layout_prices: Floats
    reduced_cost_limits: Floats
    bound_reduction: float


class ArcMaster:
    """Minimum-cost flow of one unit per object through its arcs, subject to the conflict rows.

    A layout term is the squared one, of the solver `l2`.
    """

    def __init__(self, network: Network, *, meter: BudgetMeter | None = None) -> None:
        self._network = network
        self._meter = meter or BudgetMeter()
        self._highs = create_highs(growing=True, presolve=True)
        objects, frames, states = network.node.shape
        none = np.empty(0, dtype=np.int64)
        self._arcs = ArcSet(none, none, none, none)
        self._columns = np.empty(0, dtype=np.int64)
        self._known = np.zeros((frames, objects, states, states), dtype=np.bool_)
        self._node_rows = np.full((objects, frames, states), _NO_ROW)
        self._conflict_rows: list[int] = []
        self._members = RowMembers(network)
        self.rows: list[ConflictRow] = []
        ones = np.ones(objects)
        self._empty_rows(ones, ones)
        self._layout = None
        if network.layout and frames > 1:
            self._layout = LayoutConstraints(network, self._highs)
        self._values = np.empty(0)

    def _empty_rows(self, lower: Floats, upper: Floats) -> Ints:
        first = self._highs.getNumRow()
        starts, none = np.zeros(len(lower), dtype=np.int32), np.empty(0, dtype=np.int32)
        self._highs.addRows(len(lower), lower, upper, 0, starts, none, np.empty(0))
        return np.arange(first, first + len(lower))

    def add_arcs(self, arcs: ArcSet) -> int:
        """Add the arcs that are new; return how many."""
        new = ~self._known[arcs.frame, arcs.owner, arcs.origin, arcs.target]
        arcs = arcs.select(new)
        if not len(arcs):
            return 0
        self._known[arcs.frame, arcs.owner, arcs.origin, arcs.target] = True
        self._add_node_rows(arcs)
        column, row, value = self._entries(arcs)
        order = np.argsort(column, kind="stable")
        starts = np.searchsorted(column[order], np.arange(len(arcs))).astype(np.int32)
        zeros, unbounded = np.zeros(len(arcs)), np.full(len(arcs), np.inf)
        first = self._highs.getNumCol()
        self._highs.addCols(
            len(arcs),
            self._costs(arcs),
            zeros,
            unbounded,
            len(row),
            starts,
            row[order].astype(np.int32),
            value[order],
        )
        self._arcs = self._arcs.concatenate(arcs)
        self._columns = np.concatenate([self._columns, np.arange(first, first + len(arcs))])
        return len(arcs)

    def _costs(self, arcs: ArcSet) -> Floats:
        """Return the costs of arcs; the arcs into the last frame include the sink's."""
        network = self._network
        n, m, i, j = arcs.owner, arcs.frame, arcs.origin, arcs.target
        costs = network.node[n, m, j]
        inner = m > 0
        costs[~inner] += network.source[n[~inner], j[~inner]]
        costs[inner] += network.pair[network.pair_sets[n[inner]], m[inner] - 1, i[inner], j[inner]]
        last = m == network.frames - 1
        costs[last] += network.sink[n[last], j[last]]
        return costs

    def _add_node_rows(self, arcs: ArcSet) -> None:
        """Add flow conservation for the nodes that arcs touch, except those of the last frame."""
        touched = np.zeros(self._node_rows.shape, dtype=np.bool_)
        touched[arcs.owner, arcs.frame, arcs.target] = True
        inner = arcs.frame > 0
        touched[arcs.owner[inner], arcs.frame[inner] - 1, arcs.origin[inner]] = True
        touched[:, -1] = False
        touched &= self._node_rows == _NO_ROW
        zeros = np.zeros(int(touched.sum()))
        if len(zeros):
            self._node_rows[touched] = self._empty_rows(zeros, zeros)

    def _entries(self, arcs: ArcSet) -> tuple[Ints, Ints, Floats]:
        """Return columns (counted from the first of these arcs), rows and values."""
        n, m, i, j = arcs.owner, arcs.frame, arcs.origin, arcs.target
        index = np.arange(len(arcs))
        first, inner, outgoing = m == 0, m > 0, m < self._network.frames - 1
        columns = [index[first], index[inner], index[outgoing]]
        rows = [
            n[first],
            self._node_rows[n[inner], m[inner] - 1, i[inner]],
            self._node_rows[n, m, j][outgoing],
        ]
        values = [np.ones(int(first.sum())), np.full(int(inner.sum()), -1.0), np.ones(int(outgoing.sum()))]
        through, row = self._members.of_arcs(n, m, j)
        columns.append(through)
        rows.append(np.array(self._conflict_rows, dtype=np.int64)[row])
        values.append(np.ones(len(through)))
        if self._layout is not None:
            moved = index[inner]
            layout_rows, layout_values = self._layout.entries(n[inner], m[inner] - 1, i[inner], j[inner])
            columns.append(np.repeat(moved, layout_rows.shape[1]))
            rows.append(layout_rows.ravel())
            values.append(layout_values.ravel())
        return np.concatenate(columns), np.concatenate(rows), np.concatenate(values)

    def add_rows(self, rows: Sequence[ConflictRow]) -> None:
        """Add conflict rows."""
        self._members.add(rows)
        for row in rows:
            arcs = self._arcs
            through = np.flatnonzero((arcs.frame == row.frame) & row.members[arcs.owner, arcs.target])
            self._conflict_rows.append(self._highs.getNumRow())
            self.rows.append(row)
            index = self._columns[through].astype(np.int32)
            self._highs.addRow(-np.inf, 1.0, len(index), index, np.ones(len(index)))

    def solve(self) -> ArcMasterSolution:
        """Solve the restricted program.

        Raises:
            WorkLimitError: the meter's budget is spent before; `usage` is the last solution's.
        """
        found = self._run()
        self._values = found.values[self._columns]
        objects, frames = self._network.objects, self._network.frames
        prices = np.maximum(0.0, -found.duals[self._conflict_rows]) if self.rows else np.empty(0)
        layout_prices, bound_reduction = np.zeros((objects, frames - 1, BOX_SIDES)), float(prices.sum())
        if self._layout is not None:
            forces = self._layout.forces(found.duals)
            layout_prices = self._layout.layout_prices(forces)
            bound_reduction += self._layout.bound_reduction(forces)
        return ArcMasterSolution(
            found.objective, prices, layout_prices, found.duals[:objects], bound_reduction
        )

    def _run(self) -> LinearSolution:
        if self._layout is None:
            return run_highs(self._highs, self._meter)
        # Imported on demand: only the solver `l2` needs it.
        from tracking.solvers.programs.quadratic_program import solve_quadratic_program  # noqa: PLC0415

        return solve_quadratic_program(
            self._highs.getLp(), self._layout.squares, self._network.layout, self._meter
        )

    def usage(self) -> Floats:
        """Return y (n, M, S), the flow through each node."""
        usage = np.zeros(self._network.node.shape)
        arcs = self._arcs.select(np.arange(len(self._arcs)) < len(self._values))
        np.add.at(usage, (arcs.owner, arcs.frame, arcs.target), self._values)
        return usage


def find_improving_arcs(
    trellis: Trellis, passes: MinMarginals, limits: Floats, max_states: int
) -> tuple[ArcSet, Floats]:
    """Return the arcs (A,) whose best path costs less than its object's limit (n,), and that cost (A,).

    Only arcs between the `max_states` cheapest states of each frame and object are considered.
    """
    through = passes.through
    width = int((through < limits[:, None, None]).sum(axis=2).max(initial=0))
    packed = PrunedStates.cheapest(through, max(min(width, max_states), 1))
    n, j = np.nonzero(packed.states(through, np.inf)[:, 0] < limits[:, None])
    zero = np.zeros(len(n), dtype=np.int64)
    begin = ArcSet(n, zero, zero, packed.index[n, 0, j])
    begin_costs = through[n, 0, begin.target]

    forward_costs, backward_costs = (
        np.swapaxes(passed, 0, 1) for passed in (passes.forward, passes.backward)
    )
    costs = packed.pairs(trellis)
    costs += packed.states(forward_costs, np.inf)[:, :-1, :, None]
    costs += packed.states(backward_costs + trellis.node, np.inf)[:, 1:, None, :]
    n, m, i, j = np.nonzero(costs < limits[:, None, None, None])
    between = ArcSet(n, m + 1, packed.index[n, m, i], packed.index[n, m + 1, j])
    return begin.concatenate(between), np.concatenate([begin_costs, costs[n, m, i, j]])
