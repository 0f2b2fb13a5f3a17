"""The relaxation over arcs as columns, restricted to the arcs met so far: paths recombine by themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import BOX_SIDES, Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.cutting_planes import ConflictRow
from tracking.solvers.layout_rows import LayoutConstraints
from tracking.solvers.linear_program import create_highs, run_highs
from tracking.solvers.objective import Ints
from tracking.solvers.viterbi import MinMarginals, PrunedStates, Trellis

_NO_ROW = -1


@dataclass(frozen=True, slots=True, eq=False)
class ArcSet:
    """ArcSet into `target` of `frame` from `origin` of the frame before (from the source in frame 0).

    Attributes:
        owner: (A,) the object.
        frame: (A,) the frame of the target.
        origin: (A,) the state left; 0 where that is the source.
        target: (A,) the state entered.
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
        """Return these arcs and more."""
        return ArcSet(
            np.concatenate([self.owner, more.owner]),
            np.concatenate([self.frame, more.frame]),
            np.concatenate([self.origin, more.origin]),
            np.concatenate([self.target, more.target]),
        )


def path_arcs(owners: Ints, nodes: Ints) -> ArcSet:
    """Return the arcs on paths, `nodes` (P, M), of the objects `owners` (P,), each arc once."""
    path, frame = (index.ravel() for index in np.indices(nodes.shape))
    before = np.zeros_like(nodes)
    before[:, 1:] = nodes[:, :-1]
    once = np.unique(np.stack([owners[path], frame, before.ravel(), nodes.ravel()]), axis=1)
    return ArcSet(*once)


@dataclass(frozen=True, slots=True, eq=False)
class ArcMasterSolution:
    """The optimum of a restricted program.

    Attributes:
        objective: its cost.
        prices: (R,) what going through each conflict row costs, not negative.
        layout_prices: (n, M - 1, 4) what a move by a pixel earns, by the layout term.
        reduced_cost_limits: (n,) the cost below which a path of an object would better the program.
        charge: what the prices and the layout term take off the bound.
    """

    objective: float
    prices: Floats
    layout_prices: Floats
    reduced_cost_limits: Floats
    charge: float


class ArcMaster:
    """Sends one unit of flow through the arcs of each object, as cheaply as the rows allow.

    With `squared`, the layout term is that of the L2 norm.
    """

    def __init__(self, network: Network, *, squared: bool = False) -> None:
        self._network = network
        self._highs = create_highs(growing=True, presolve=not squared)
        objects, frames, states = network.node.shape
        none = np.empty(0, dtype=np.int64)
        self._arcs = ArcSet(none, none, none, none)
        self._columns = np.empty(0, dtype=np.int64)
        self._known = np.zeros((frames, objects, states, states), dtype=np.bool_)
        self._node_rows = np.full((objects, frames, states), _NO_ROW)
        self._conflict_rows: list[int] = []
        self.rows: list[ConflictRow] = []
        ones = np.ones(objects)
        self._empty_rows(ones, ones)
        self._layout = None
        if network.layout and frames > 1:
            self._layout = LayoutConstraints(network, self._highs, squared=squared)
        self._values = np.empty(0)

    def _empty_rows(self, lower: Floats, upper: Floats) -> Ints:
        first = self._highs.getNumRow()
        starts, none = np.zeros(len(lower), dtype=np.int32), np.empty(0, dtype=np.int32)
        self._highs.addRows(len(lower), lower, upper, 0, starts, none, np.empty(0))
        return np.arange(first, first + len(lower))

    def add_arcs(self, arcs: ArcSet) -> int:
        """Add the arcs that are new; return their numbers."""
        fresh = ~self._known[arcs.frame, arcs.owner, arcs.origin, arcs.target]
        arcs = arcs.select(fresh)
        if not len(arcs):
            return 0
        self._known[arcs.frame, arcs.owner, arcs.origin, arcs.target] = True
        self._add_node_rows(arcs)
        column, row, value = self._entries(arcs)
        order = np.argsort(column, kind="stable")
        starts = np.searchsorted(column[order], np.arange(len(arcs))).astype(np.int32)
        zeros, endless = np.zeros(len(arcs)), np.full(len(arcs), np.inf)
        first = self._highs.getNumCol()
        self._highs.addCols(
            len(arcs),
            self._costs(arcs),
            zeros,
            endless,
            len(row),
            starts,
            row[order].astype(np.int32),
            value[order],
        )
        self._arcs = self._arcs.concatenate(arcs)
        self._columns = np.concatenate([self._columns, np.arange(first, first + len(arcs))])
        return len(arcs)

    def _costs(self, arcs: ArcSet) -> Floats:
        """Return the costs of arcs; the sink's is on the arcs into the last frame."""
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
        """Conserve the flow in all nodes that arcs touch, but those of the last frame, its end."""
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
        every = np.arange(len(arcs))
        first, inner, going = m == 0, m > 0, m < self._network.frames - 1
        columns = [every[first], every[inner], every[going]]
        rows = [n[first], self._node_rows[n[inner], m[inner] - 1, i[inner]], self._node_rows[n, m, j][going]]
        values = [np.ones(int(first.sum())), np.full(int(inner.sum()), -1.0), np.ones(int(going.sum()))]
        for number, row in zip(self._conflict_rows, self.rows, strict=True):
            through = np.flatnonzero((m == row.frame) & row.members[n, j])
            columns.append(through)
            rows.append(np.full(len(through), number))
            values.append(np.ones(len(through)))
        if self._layout is not None:
            moved = every[inner]
            at, values_of_moves = self._layout.entries(n[inner], m[inner] - 1, i[inner], j[inner])
            columns.append(np.repeat(moved, at.shape[1]))
            rows.append(at.ravel())
            values.append(values_of_moves.ravel())
        return np.concatenate(columns), np.concatenate(rows), np.concatenate(values)

    def add_rows(self, rows: Sequence[ConflictRow]) -> None:
        """Bind the program by more conflict rows."""
        for row in rows:
            arcs = self._arcs
            through = np.flatnonzero((arcs.frame == row.frame) & row.members[arcs.owner, arcs.target])
            self._conflict_rows.append(self._highs.getNumRow())
            self.rows.append(row)
            index = self._columns[through].astype(np.int32)
            self._highs.addRow(-np.inf, 1.0, len(index), index, np.ones(len(index)))

    def solve(self) -> ArcMasterSolution:
        """Choose anew."""
        found = run_highs(self._highs)
        self._values = found.values[self._columns]
        objects, frames = self._network.objects, self._network.frames
        prices = np.maximum(0.0, -found.duals[self._conflict_rows]) if self.rows else np.empty(0)
        pulls, charge = np.zeros((objects, frames - 1, BOX_SIDES)), float(prices.sum())
        if self._layout is not None:
            forces = self._layout.forces(found.duals)
            pulls, charge = self._layout.layout_prices(forces), charge + self._layout.slack(forces)
        return ArcMasterSolution(found.objective, prices, pulls, found.duals[:objects], charge)

    def usage(self) -> Floats:
        """Return y (n, M, S)."""
        usage = np.zeros(self._network.node.shape)
        arcs = self._arcs
        np.add.at(usage, (arcs.owner, arcs.frame, arcs.target), self._values)
        return usage


def find_improving_arcs(
    trellis: Trellis, passes: MinMarginals, worths: Floats, most: int
) -> tuple[ArcSet, Floats]:
    """Return the arcs (A,) whose best path costs less than `worths` (n,) of its object, and that cost (A,).

    Only arcs between the `most` cheapest states of each frame and object are looked at.
    """
    through = passes.through
    width = int((through < worths[:, None, None]).sum(axis=2).max(initial=0))
    packed = PrunedStates.cheapest(through, max(min(width, most), 1))
    n, j = np.nonzero(packed.states(through, np.inf)[:, 0] < worths[:, None])
    zero = np.zeros(len(n), dtype=np.int64)
    begin = ArcSet(n, zero, zero, packed.index[n, 0, j])
    begin_costs = through[n, 0, begin.target]

    ahead, behind = (np.swapaxes(passed, 0, 1) for passed in (passes.forward, passes.backward))
    costs = packed.pairs(trellis.pair)
    costs += packed.states(ahead, np.inf)[:, :-1, :, None]
    costs += packed.states(behind + trellis.node, np.inf)[:, 1:, None, :]
    n, m, i, j = np.nonzero(costs < worths[:, None, None, None])
    between = ArcSet(n, m + 1, packed.index[n, m, i], packed.index[n, m + 1, j])
    return begin.concatenate(between), np.concatenate([begin_costs, costs[n, m, i, j]])
