"""`columns`: the relaxation of paper II.D by column generation, with a proof. The default solver."""

from __future__ import annotations

from tracking.network import Network
from tracking.solvers.arc_search import arc_search
from tracking.solvers.base import Solution
from tracking.solvers.conflict_finder import ConflictFinder
from tracking.solvers.finish import finished, nothing
from tracking.solvers.hint import Hint
from tracking.solvers.path_search import PathSearch
from tracking.solvers.pricing import Pricing
from tracking.solvers.relaxed import Relaxed
from tracking.solvers.timed import TimedSolver
from tracking.solvers.viterbi import Trellis


class Columns(TimedSolver):
    """The optimum of the relaxation from a few of its columns; equal to `arcs`, and many times faster."""

    name = "columns"

    def _answer(self, network: Network, hint: Hint | None) -> Solution:
        """Solve the relaxation and round it where it is not whole."""
        if not network.objects:
            return nothing(self.name, network)
        return finished(self.name, network, relaxation_by_columns(network, hint))


def relaxation_by_columns(network: Network, hint: Hint | None = None) -> Relaxed:
    """Give the optimum of the relaxation of a network with at least one object.

    Paths are the columns where only conflicts couple the objects; under the layout term, which whole
    paths fit badly, arcs are.
    """
    if not network.layout:
        return PathSearch(network).run(hint)
    return arc_search(network, Pricing(Trellis.of(network)), ConflictFinder(network)).run()
