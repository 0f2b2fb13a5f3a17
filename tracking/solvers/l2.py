"""`l2`: the layout term with the square of the L2 norm, a quadratic program (paper II.C)."""

from __future__ import annotations

import numpy as np

from tracking.network import Network
from tracking.solvers.arc_master import ArcMaster, arcs_of_paths
from tracking.solvers.arc_search import ArcSearch
from tracking.solvers.base import Solution
from tracking.solvers.columns import relaxation_by_columns
from tracking.solvers.conflict_finder import ConflictFinder
from tracking.solvers.finish import finished, nothing
from tracking.solvers.greedy_dp import greedy_paths
from tracking.solvers.hint import Hint
from tracking.solvers.improve import Improver
from tracking.solvers.timed import TimedSolver

_SQUARE = 2


class L2(TimedSolver):
    """As `columns`, but a change of layout by d pixels costs μ d²: many small changes rather than a jump.

    Without layout term or a second object it is `columns`.
    """

    name = "l2"

    def _answer(self, network: Network, _hint: Hint | None) -> Solution:
        """Solve the relaxation and round it where it is not whole."""
        if not network.objects:
            return nothing(self.name, network)
        if not network.layout:
            return finished(self.name, network, relaxation_by_columns(network))
        start = Improver(network, _SQUARE).improved(greedy_paths(network).nodes)
        starts = arcs_of_paths(np.arange(network.objects), start)
        found = _SquaredSearch(network, starts, [], ConflictFinder(network)).run()
        return finished(self.name, network, found, _SQUARE)


class _SquaredSearch(ArcSearch):
    """The same search with the quadratic program."""

    def _new_master(self) -> ArcMaster:
        return ArcMaster(self._network, squared=True)
