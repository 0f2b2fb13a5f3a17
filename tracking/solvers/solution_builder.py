"""Builds the solution and its report from the optimum of the relaxation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.base import Solution, SolveReport
from tracking.solvers.budget import BudgetMeter, Limit
from tracking.solvers.dynamic_programming import greedy_paths
from tracking.solvers.heuristics.candidates import candidate_nodes
from tracking.solvers.heuristics.local_search import LocalSearch
from tracking.solvers.heuristics.recombination import recombine
from tracking.solvers.heuristics.rounding import round_relaxation
from tracking.solvers.hidden_paths import allow_hiding
from tracking.solvers.objective import Ints, conflict_count, states_from_nodes, total_cost
from tracking.solvers.relaxation import CLOSE_GAP, RelaxedSolution
from tracking.solvers.viterbi import MinMarginals, Trellis, best_paths
from tracking.solvers.warm_start import ConflictPrice, WarmStart

_TOLERANCE = 1e-9
"""Relative tolerance of bounds, for the rounding errors of sums of costs."""


def solution_from_relaxation(
    solver: str,
    network: Network,
    found: RelaxedSolution,
    meter: BudgetMeter,
    power: int = 1,
    warm_start: WarmStart | None = None,
) -> Solution:
    """Return the solution for the optimum of the relaxation; `power` is that of the layout term."""
    nodes = integer_nodes(network, found, power, warm_start, meter)
    return build_solution(network, nodes, Certificate.of(solver, found, meter), power)


def integer_nodes(
    network: Network,
    found: RelaxedSolution,
    power: int = 1,
    warm_start: WarmStart | None = None,
    meter: BudgetMeter | None = None,
) -> Ints:
    """Return nodes (n, M) without conflicts for the relaxation's y.

    If y is integral, they are its paths. Otherwise the relaxation's answer is improved by local search, and
    so are the rounded y (II.D), the cheapest of `candidate_nodes` and the greedy paths, until one is close to
    the bound. The cheapest of all are returned, so no answer is dearer than hiding everybody.
    """
    if found.limit or not found.is_optimum:
        # The flow of a search that has not ended may violate rows; shares below 1 are rounded in each frame.
        nodes = round_relaxation(network, 0.5 * found.usage)
    else:
        nodes = round_relaxation(network, found.usage)
        if found.is_integral and np.isfinite(total_cost(network, nodes, power)):
            return nodes
    network = allow_hiding(network)
    alone = best_paths(Trellis.of(network))
    if found.answer:
        improver = LocalSearch(network, power, meter, found.answer.near_arcs)
    else:
        greedy = greedy_paths(network, alone).nodes
        states = None if network.layout else _states_within(found, total_cost(network, greedy))
        improver = LocalSearch(network, power, meter, states=states)

    def starts() -> Iterator[Ints]:
        if found.answer:
            yield found.answer.nodes
        candidates = candidate_nodes(network, alone, warm_start)
        candidate = min(candidates, key=lambda start: total_cost(network, start, power))
        yield from sorted([nodes, candidate], key=lambda start: total_cost(network, start, power))
        yield greedy_paths(network, alone).nodes if found.answer else greedy

    known: list[Ints] = []
    improved: list[Ints] = []
    close = 0.0 if found.is_optimum else CLOSE_GAP
    for start in starts():
        if conflict_count(network, start):
            continue
        known.append(start)
        improved.append(improver.improve(start))
        best = min(improved, key=lambda nodes: total_cost(network, nodes, power))
        cost = total_cost(network, best, power)
        if cost - found.bound <= close * max(1.0, abs(cost)):
            return best
    return improver.improve(recombine(network, [best, *improved, *known], power, improver.meter))


def _states_within(found: RelaxedSolution, cost: float) -> Bools:
    """Return which states (n, M, S) answers without layout term that cost no more than `cost` may have."""
    passes = MinMarginals.of(found.priced)
    gap = max(cost - found.bound, 0.0) + _TOLERANCE * max(1.0, abs(cost))
    return np.asarray(passes.through - passes.least[:, None, None] <= gap)


@dataclass(frozen=True, slots=True)
class Certificate:
    """What a solver has proven: see `SolveReport` and `Solution`."""

    solver: str
    bound: float
    integral: bool
    rounds: int
    prices: tuple[ConflictPrice, ...] = ()
    limit: Limit | None = None
    skipped: tuple[str, ...] = ()

    @classmethod
    def of(cls, solver: str, found: RelaxedSolution, meter: BudgetMeter) -> Certificate:
        """Return what the relaxation has proven, and what the budget has cut after it."""
        integral = found.is_integral
        skipped = ["relaxation"] if found.limit else []
        limit = found.limit
        if not integral and (rest := meter.reached()):
            limit = limit or rest
            skipped.append("local search")
        return cls(solver, found.bound, integral, found.rounds, found.prices, limit, tuple(skipped))


def build_solution(network: Network, nodes: Ints, proof: Certificate, power: int = 1) -> Solution:
    """Return the solution of nodes (n, M), with its report.

    The bound is limited to the cost, which removes rounding errors.
    """
    cost = total_cost(network, nodes, power)
    report = SolveReport(
        solver=proof.solver,
        objective=cost,
        bound=min(proof.bound, cost),
        integral=proof.integral,
        conflicts=conflict_count(network, nodes),
        rounds=proof.rounds,
        limit=proof.limit,
        skipped=proof.skipped,
    )
    return Solution(states_from_nodes(network, nodes), report, proof.prices)


def empty_solution(solver: str, network: Network) -> Solution:
    """Return the solution of a network without objects."""
    nodes = np.empty((0, network.frames), dtype=np.int64)
    return build_solution(network, nodes, Certificate(solver, 0.0, integral=True, rounds=0))
