"""The relaxation with whole paths as columns (Dantzig-Wolfe), restricted to the paths added so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.boxes import Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.budget import BudgetMeter
from tracking.solvers.cutting_planes import ConflictRow, RowMembers
from tracking.solvers.objective import Ints
from tracking.solvers.programs.linear_program import create_highs, run_highs
from tracking.solvers.viterbi import Paths


@dataclass(frozen=True, slots=True, eq=False)
class PathMasterSolution:
    """The optimum of a restricted program.

    Attributes:
        objective: its cost.
        prices: (R,) the price of each conflict row, not negative.
        reduced_cost_limits: (n,) the cost below which a path of an object improves the program.
    """

    objective: float
    prices: Floats
    reduced_cost_limits: Floats


class PathMaster:
    """Finds the cheapest convex combination of paths of its objects that satisfies the conflict rows."""

    def __init__(self, network: Network, meter: BudgetMeter | None = None) -> None:
        self._network = network
        self._meter = meter
        self._highs = create_highs(growing=True)
        self._known: set[tuple[int, bytes]] = set()
        self._owners = np.empty(0, dtype=np.int64)
        self._paths = np.empty((0, network.frames), dtype=np.int64)
        self._values = np.empty(0)
        self._object_rows: dict[int, int] = {}
        self._conflict_rows: list[int] = []
        self.rows: list[ConflictRow] = []
        self.members = RowMembers(network)

    def add_objects(self, objects: Sequence[int]) -> None:
        """Add these objects to the program; they need paths before the next `solve`."""
        first = len(self._object_rows) + len(self.rows)
        self._object_rows.update({n: first + k for k, n in enumerate(objects)})
        count = len(objects)
        starts = np.zeros(count, dtype=np.int32)
        self._highs.addRows(
            count, np.ones(count), np.ones(count), 0, starts, np.empty(0, dtype=np.int32), np.empty(0)
        )

    def add_paths(self, owners: Ints, paths: Paths) -> int:
        """Add the paths that are new; return how many."""
        new = []
        for k, (owner, nodes) in enumerate(zip(owners.tolist(), paths.nodes, strict=True)):
            key = (owner, nodes.tobytes())
            if key not in self._known and np.isfinite(paths.costs[k]):
                self._known.add(key)
                new.append(k)
        if not new:
            return 0
        owners, nodes = owners[new], paths.nodes[new]
        entries = self._entries(owners, nodes)
        column, row = np.nonzero(entries)
        starts = np.searchsorted(column, np.arange(len(new))).astype(np.int32)
        index = np.concatenate([self._row_numbers(), self._conflict_rows]).astype(np.int32)[row]
        zeros, unbounded = np.zeros(len(new)), np.full(len(new), np.inf)
        self._highs.addCols(
            len(new), paths.costs[new], zeros, unbounded, len(row), starts, index, np.ones(len(row))
        )
        self._owners = np.concatenate([self._owners, owners])
        self._paths = np.concatenate([self._paths, nodes])
        return len(new)

    def _row_numbers(self) -> Ints:
        return np.array(list(self._object_rows.values()), dtype=np.int64)

    def _entries(self, owners: Ints, nodes: Ints) -> Bools:
        """Return which rows each path is in, (paths, object rows then conflict rows)."""
        own = owners[:, None] == np.array(list(self._object_rows), dtype=np.int64)
        return np.hstack([own, self.members.of_paths(owners, nodes)])

    def add_rows(self, rows: Sequence[ConflictRow]) -> None:
        """Add conflict rows."""
        self.members.add(rows)
        for row in rows:
            through = np.flatnonzero(row.members[self._owners, self._paths[:, row.frame]])
            self._conflict_rows.append(len(self._object_rows) + len(self.rows))
            self.rows.append(row)
            self._highs.addRow(-np.inf, 1.0, len(through), through.astype(np.int32), np.ones(len(through)))

    def solve(self) -> PathMasterSolution:
        """Solve the restricted program.

        Raises:
            WorkLimitError: the meter's budget is spent before; `write_usage` writes the last solution.
        """
        found = run_highs(self._highs, self._meter)
        self._values = found.values
        limits = np.full(self._network.objects, np.inf)
        limits[list(self._object_rows)] = found.duals[self._row_numbers()]
        prices = np.maximum(0.0, -found.duals[self._conflict_rows]) if self.rows else np.empty(0)
        return PathMasterSolution(found.objective, prices, limits)

    def used_paths(self) -> tuple[Ints, Ints]:
        """Return the paths in use: their objects (P,) and nodes (P, M)."""
        used = np.flatnonzero(self._values > 0.0)
        return self._owners[used], self._paths[used]

    def write_usage(self, usage: Floats) -> None:
        """Write y of the program's objects into `usage` (n, M, S)."""
        usage[list(self._object_rows)] = 0.0
        frames = np.arange(self._network.frames)
        used = np.flatnonzero(self._values > 0.0)
        np.add.at(usage, (self._owners[used, None], frames, self._paths[used]), self._values[used, None])
