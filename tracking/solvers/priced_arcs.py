"""The arcs that better a program: those on paths that cost less than what the program pays for one."""

from __future__ import annotations

import numpy as np

from tracking.boxes import Floats
from tracking.solvers.arc_master import ArcSet
from tracking.solvers.packed import Packed
from tracking.solvers.viterbi import Marginals, Trellis


def arcs_through(trellis: Trellis, passes: Marginals, worths: Floats, most: int) -> tuple[ArcSet, Floats]:
    """Give the arcs (A,) whose best path costs less than `worths` (n,) of its object, and that cost (A,).

    Only arcs between the `most` cheapest states of each frame and object are looked at.
    """
    through = passes.through
    width = int((through < worths[:, None, None]).sum(axis=2).max(initial=0))
    packed = Packed.cheapest(through, max(min(width, most), 1))
    n, j = np.nonzero(packed.states(through, np.inf)[:, 0] < worths[:, None])
    zero = np.zeros(len(n), dtype=np.int64)
    begin = ArcSet(n, zero, zero, packed.index[n, 0, j])
    begin_costs = through[n, 0, begin.target]

    ahead, behind = (np.swapaxes(passed, 0, 1) for passed in (passes.ahead, passes.behind))
    costs = packed.pairs(trellis.pair)
    costs += packed.states(ahead, np.inf)[:, :-1, :, None]
    costs += packed.states(behind + trellis.node, np.inf)[:, 1:, None, :]
    n, m, i, j = np.nonzero(costs < worths[:, None, None, None])
    between = ArcSet(n, m + 1, packed.index[n, m, i], packed.index[n, m + 1, j])
    return begin.and_also(between), np.concatenate([begin_costs, costs[n, m, i, j]])
