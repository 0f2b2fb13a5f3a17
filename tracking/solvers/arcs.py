"""`arcs`: the full linear program of paper II.D, the reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from tracking.network import Network
from tracking.solvers.arc_program import ArcProgram, arc_program
from tracking.solvers.base import Solution
from tracking.solvers.finish import finished, nothing
from tracking.solvers.highs import LinearProgram, solve_program
from tracking.solvers.hint import Hint
from tracking.solvers.relaxed import Relaxed
from tracking.solvers.timed import TimedSolver


class Arcs(TimedSolver):
    """All arcs of the window in one program; slow, and simple enough to trust."""

    name = "arcs"

    def _answer(self, network: Network, _hint: Hint | None) -> Solution:
        """Solve the relaxation and round it where it is not whole."""
        if not network.objects:
            return nothing(self.name, network)
        return finished(self.name, network, relaxation(network))


def relaxation(network: Network) -> Relaxed:
    """Give the optimum of the full relaxation of a network with at least one object; no prices.

    The program is that of II.D with y replaced by the sums of arcs that define it: half the simplex
    iterations, the fastest way that is known to solve all arcs at once.
    """
    built = arc_program(network)
    short = without_nodes(built)
    found = solve_program(short.program)
    usage = np.zeros(network.node.shape)
    usage[built.nodes >= 0] = short.sums @ found.values
    return Relaxed(usage, found.objective, network.node, rounds=1)


@dataclass(frozen=True, slots=True, eq=False)
class ShortProgram:
    """The program without y: `sums` (y, columns) times its columns gives them back."""

    program: LinearProgram
    sums: sparse.csr_array


def without_nodes(built: ArcProgram) -> ShortProgram:
    """Replace each y by the sum of arcs that its row sets it equal to."""
    program = built.program
    nodes = built.nodes[built.nodes >= 0]
    others = np.ones(len(program.costs), dtype=np.bool_)
    others[nodes] = False
    kept = np.ones(len(program.row_lower), dtype=np.bool_)
    kept[built.defining] = False
    rows = sparse.csr_array(program.matrix)
    sums = rows[built.defining][:, others]
    matrix = rows[kept][:, others] + rows[kept][:, nodes] @ sums
    short = LinearProgram(
        costs=program.costs[others],
        lower=program.lower[others],
        upper=program.upper[others],
        matrix=sparse.csc_array(matrix),
        row_lower=program.row_lower[kept],
        row_upper=program.row_upper[kept],
    )
    return ShortProgram(short, sums)
