"""The linear program of paper II.D as written: a variable for each arc ξ, node y, location p and p+, p-."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tracking.boxes import BOX_SIDES
from tracking.model.network import Network
from tracking.solvers.base import Solution, TimedSolver
from tracking.solvers.budget import RELAXATION_SHARE, BudgetMeter
from tracking.solvers.programs.linear_program import (
    LinearProgram,
    LinearProgramBuilder,
    WorkLimitError,
    solve_program,
)
from tracking.solvers.relaxation import RelaxedSolution
from tracking.solvers.solution_builder import empty_solution, solution_from_relaxation
from tracking.solvers.viterbi import Trellis, best_paths
from tracking.solvers.warm_start import WarmStart

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class ArcProgram:
    """The program and the indices of its variables.

    Attributes:
        program: the linear program.
        nodes: (n, M, S) the column of each y, -1 where there is no such node.
        defining: (y,) the rows that define the y as sums of arcs, in the order of their columns.
        arcs: the number of arc columns, which come first.
        moves: (pairs, M - 1, 4, 2) the columns p+ and p- of the layout term; empty when μ is 0.
    """

    program: LinearProgram
    nodes: Ints
    defining: Ints
    arcs: int
    moves: Ints


def build_arc_program(network: Network, allowed_arcs: NDArray[np.bool_] | None = None) -> ArcProgram:
    """Build the program of a network with at least one object.

    `allowed_arcs` (n, M - 1, S, S) restricts the arcs between frames.
    """
    build = LinearProgramBuilder()
    exists = np.isfinite(network.node)
    # Arcs are the first columns, then nodes; the flow rows connect them.
    pair = network.pair[network.pair_sets] + network.node[:, 1:, None, :]
    usable = np.isfinite(pair) & exists[:, :-1, :, None]
    if allowed_arcs is not None:
        usable &= allowed_arcs
    start = network.source + network.node[:, 0]
    from_source, between, to_sink = np.nonzero(np.isfinite(start)), np.nonzero(usable), _ends(network, exists)
    source_arcs = build.add_columns(start[from_source])
    pair_arcs = build.add_columns(pair[between])
    sink_arcs = build.add_columns(network.sink[to_sink])
    nodes = np.full(network.node.shape, -1, dtype=np.int64)
    nodes[exists] = build.add_columns(np.zeros(int(exists.sum())))

    count = int(exists.sum())
    into, out_of = np.full(nodes.shape, -1), np.full(nodes.shape, -1)
    into[exists], out_of[exists] = build.add_rows(count, 0.0, 0.0), build.add_rows(count, 0.0, 0.0)
    build.add_entries(into[exists], nodes[exists], -1.0)
    build.add_entries(out_of[exists], nodes[exists], -1.0)
    build.add_entries(build.add_rows(network.objects, 1.0, 1.0)[from_source[0]], source_arcs, 1.0)
    build.add_entries(build.add_rows(network.objects, 1.0, 1.0)[to_sink[0]], sink_arcs, 1.0)
    build.add_entries(into[from_source[0], 0, from_source[1]], source_arcs, 1.0)
    n, m, i, j = between
    build.add_entries(out_of[n, m, i], pair_arcs, 1.0)
    build.add_entries(into[n, m + 1, j], pair_arcs, 1.0)
    build.add_entries(out_of[to_sink[0], -1, to_sink[1]], sink_arcs, 1.0)

    _add_conflicts(build, network, nodes)
    arcs = len(source_arcs) + len(pair_arcs) + len(sink_arcs)
    moves = _add_layout(build, network, nodes)
    return ArcProgram(build.program(), nodes, into[exists], arcs, moves)


def _ends(network: Network, exists: NDArray[np.bool_]) -> tuple[Ints, ...]:
    return np.nonzero(np.isfinite(network.sink) & exists[:, -1])


def _add_conflicts(build: LinearProgramBuilder, network: Network, nodes: Ints) -> None:
    """Add the constraint of at most one path through each conflict row."""
    for m in range(network.frames):
        rows = network.rows(m)
        row, n, place = np.nonzero(rows)
        column = nodes[n, m, place]
        build.add_entries(build.add_rows(len(rows), -np.inf, 1.0)[row[column >= 0]], column[column >= 0], 1.0)


def _add_layout(build: LinearProgramBuilder, network: Network, nodes: Ints) -> Ints:
    """Add p, defined by y, and p+ - p- = the change of the vector between two objects, for all pairs."""
    pairs = list(combinations(range(network.objects), 2))
    steps = network.frames - 1
    if not network.layout or not pairs or not steps:
        return np.empty((len(pairs), steps, BOX_SIDES, 0), dtype=np.int64)
    shape = (network.objects, network.frames, BOX_SIDES)
    location = build.add_columns(np.zeros(int(np.prod(shape))), lower=-np.inf).reshape(shape)
    location_rows = build.add_rows(location.size, 0.0, 0.0).reshape(shape)
    build.add_entries(location_rows, location, 1.0)
    n, m, state = np.nonzero(nodes >= 0)
    build.add_entries(
        location_rows[n, m], nodes[n, m, state][:, None], -network.locations[network.sets[n], m, state]
    )

    first, second = np.array(pairs).T
    moves = build.add_columns(np.full(len(pairs) * steps * BOX_SIDES * 2, network.layout))
    moves = moves.reshape(len(pairs), steps, BOX_SIDES, 2)
    change = build.add_rows(moves.size // 2, 0.0, 0.0).reshape(moves.shape[:3])
    build.add_entries(change, moves[..., 0], 1.0)
    build.add_entries(change, moves[..., 1], -1.0)
    build.add_entries(change, location[first, :-1], -1.0)
    build.add_entries(change, location[first, 1:], 1.0)
    build.add_entries(change, location[second, :-1], 1.0)
    build.add_entries(change, location[second, 1:], -1.0)
    return moves


class ArcProgramSolver(TimedSolver):
    """Solves all arcs of the window in one program: slow, but simple."""

    name = "arcs"

    def _solve(self, network: Network, _warm_start: WarmStart | None, meter: BudgetMeter) -> Solution:
        """Solve the relaxation, and round it if it is not integral."""
        if not network.objects:
            return empty_solution(self.name, network)
        try:
            found = solve_arc_relaxation(network, meter)
        except WorkLimitError:
            alone = best_paths(Trellis.of(network))
            usage = np.zeros(network.node.shape)
            np.put_along_axis(usage, alone.nodes[:, :, None], 1.0, axis=2)
            limit = meter.reached(RELAXATION_SHARE) or "work"
            found = RelaxedSolution(
                usage, float(alone.costs.sum()), Trellis.of(network), rounds=0, limit=limit
            )
        return solution_from_relaxation(self.name, network, found, meter)


def solve_arc_relaxation(network: Network, meter: BudgetMeter) -> RelaxedSolution:
    """Return the optimum of the full relaxation of a network with at least one object; no prices.

    The program is that of II.D with y replaced by the sums of arcs that define it, which halves the simplex
    iterations.

    Raises:
        WorkLimitError: the meter's budget is spent before.
    """
    built = build_arc_program(network)
    reduced = eliminate_nodes(built)
    found = solve_program(reduced.program, meter=meter)
    usage = np.zeros(network.node.shape)
    usage[built.nodes >= 0] = reduced.sums @ found.values
    return RelaxedSolution(usage, found.objective, Trellis.of(network), rounds=1)


@dataclass(frozen=True, slots=True, eq=False)
class ReducedProgram:
    """The program without y; y is `sums` (y, columns) times its variables."""

    program: LinearProgram
    sums: sparse.csr_array


def eliminate_nodes(built: ArcProgram) -> ReducedProgram:
    """Replace each y by the sum of arcs that its row sets it equal to."""
    program = built.program
    nodes = built.nodes[built.nodes >= 0]
    is_kept = np.ones(len(program.costs), dtype=np.bool_)
    is_kept[nodes] = False
    kept_rows = np.ones(len(program.row_lower), dtype=np.bool_)
    kept_rows[built.defining] = False
    rows = sparse.csr_array(program.matrix)
    sums = rows[built.defining][:, is_kept]
    matrix = rows[kept_rows][:, is_kept] + rows[kept_rows][:, nodes] @ sums
    reduced = LinearProgram(
        costs=program.costs[is_kept],
        lower=program.lower[is_kept],
        upper=program.upper[is_kept],
        matrix=sparse.csc_array(matrix),
        row_lower=program.row_lower[kept_rows],
        row_upper=program.row_upper[kept_rows],
    )
    return ReducedProgram(reduced, sums)
