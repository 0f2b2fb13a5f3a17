"""`separate-dp`: every object on its own, conflicts and layout ignored (paper IV.A.3, Fig. 16)."""

from __future__ import annotations

from tracking.network import Network
from tracking.solvers.base import Solution, SolveReport
from tracking.solvers.hint import Hint
from tracking.solvers.objective import conflict_count, objective, states_of
from tracking.solvers.timed import TimedSolver
from tracking.solvers.viterbi import Trellis, best_paths


class SeparateDp(TimedSolver):
    """The cheapest path of each object; two objects may take one place. A baseline, and a bound."""

    name = "separate-dp"

    def _answer(self, network: Network, _hint: Hint | None) -> Solution:
        """Give the cheapest paths; the sum of their costs is the bound."""
        paths = best_paths(Trellis.of(network))
        conflicts = conflict_count(network, paths.nodes)
        cost = objective(network, paths.nodes)
        bound = float(paths.costs.sum())
        report = SolveReport(
            solver=self.name,
            objective=cost,
            bound=bound,
            integral=conflicts == 0 and not network.layout,
            conflicts=conflicts,
            rounds=1,
        )
        return Solution(states_of(network, paths.nodes), report)
