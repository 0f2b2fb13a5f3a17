"""Integer optimum: dynamic programming over the joint states that bounds do not exclude, or branch and bound.

The extended dynamic program (I.A) has S^n joint states per frame. The duals of the relaxation give a lower
bound on the cost from each of them to the end of the window; most joint states exceed a known solution by it.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.distance import cdist

from tracking.boxes import BOX_SIDES, Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.arc_program import build_arc_program
from tracking.solvers.base import Solution, TimedSolver
from tracking.solvers.budget import BudgetMeter
from tracking.solvers.column_generation import solve_relaxation
from tracking.solvers.objective import Ints, total_cost
from tracking.solvers.programs.linear_program import WorkLimitError, solve_program
from tracking.solvers.relaxation import RelaxedSolution
from tracking.solvers.solution_builder import Certificate, build_solution, empty_solution, integer_nodes
from tracking.solvers.viterbi import MinMarginals, backward, forward
from tracking.solvers.warm_start import WarmStart

_MAX_JOINT_STATES = 150_000
"""Most joint states of a frame."""

_MAX_TRANSITIONS = 2_000_000_000
"""Most pairs of joint states of successive frames over the window: about half a minute."""

_TRANSITION = 1.5e-8
"""Seconds of work for such a pair."""

_BLOCK_SIZE = 2_000_000
"""Numbers in memory at once: 16 MB."""

_TOLERANCE = 1e-9
"""Relative tolerance of bounds, for the rounding errors of sums of costs."""


class TooManyStatesError(Exception):
    """Too many joint states remain."""


@dataclass(frozen=True, slots=True, eq=False)
class _Frontier:
    """Joint states of a frame: `nodes` (J, n), `costs` (J,) from the source, predecessors `origin` (J,)."""

    nodes: Ints
    costs: Floats
    origin: Ints


class JointStateSearch:
    """Dynamic program over joint states of a network with layout term, pruned by its solved relaxation."""

    def __init__(self, network: Network, found: RelaxedSolution, meter: BudgetMeter | None = None) -> None:
        self._network = network
        self._meter = meter or BudgetMeter()
        self._bound = found.bound
        self._exclusions = network.exclusions()
        passes = MinMarginals.of(found.priced)
        self._excess = passes.through - passes.least[:, None, None]
        self._locations = network.locations[network.sets]
        # Lower bound of the cost from each state on.
        self._bound_ahead = np.swapaxes(passes.backward, 0, 1)
        # Without other objects or later frames there are no later prices.
        reductions = found.bound_reductions if len(found.bound_reductions) else np.zeros(network.frames)
        self._bound_reductions = np.append(np.cumsum(reductions[::-1])[::-1][1:], 0.0)

    def cheaper_than(self, cost: float) -> Ints | None:
        """Return the cheapest nodes (n, M) if they cost less than `cost`, else None.

        Raises:
            TooManyStatesError: the search would take too long.
            WorkLimitError: the meter's budget does not allow it.
        """
        limit = cost + _TOLERANCE * max(1.0, abs(cost))
        network = self._network
        nodes = self._candidates(0, limit)
        costs = (network.source + network.node[:, 0])[np.arange(network.objects), nodes].sum(axis=1)
        frontiers = [self._prune(0, _Frontier(nodes, costs, np.zeros(len(nodes), np.int64)), limit)]
        steps = 0
        for m in range(1, network.frames):
            nodes = self._candidates(m, limit)
            steps += len(nodes) * len(frontiers[-1].nodes)
            if steps > _MAX_TRANSITIONS:
                raise TooManyStatesError
            self._meter.work_s += _TRANSITION * len(nodes) * len(frontiers[-1].nodes)
            if self._meter.reached():
                raise WorkLimitError
            frontiers.append(self._prune(m, self._advance(m, frontiers[-1], nodes), limit))
        return self._trace_back(frontiers, cost)

    def _candidates(self, frame: int, limit: float) -> Ints:
        """Return the joint states (J, n) without conflicts that the bound allows."""
        network = self._network
        joint, excess = np.empty((1, 0), dtype=np.int64), np.zeros(1)
        for n in range(network.objects):
            own = np.flatnonzero(self._excess[n, frame] <= limit - self._bound)
            total = excess[:, None] + self._excess[n, frame, own]
            allowed = total <= limit - self._bound
            for other in range(n):
                allowed &= ~self._excluded(frame, (other, n))[np.ix_(joint[:, other], own)]
            first, second = np.nonzero(allowed)
            if len(first) > _MAX_JOINT_STATES:
                raise TooManyStatesError
            joint = np.column_stack([joint[first], own[second]])
            excess = total[first, second]
        return joint

    def _excluded(self, frame: int, pair: tuple[int, int]) -> Bools:
        """Return which states of two objects conflict, (S, S)."""
        places, sets = self._network.max_places, self._network.sets
        excluded = np.zeros((places + 1, places + 1), dtype=np.bool_)
        first, second = (slice(sets[n] * places, (sets[n] + 1) * places) for n in pair)
        excluded[:places, :places] = self._exclusions[frame, first, second]
        return excluded

    def _prune(self, frame: int, frontier: _Frontier, limit: float) -> _Frontier:
        """Drop the joint states whose bound exceeds the limit."""
        each = np.arange(self._network.objects)
        ahead = self._bound_ahead[each, frame, frontier.nodes].sum(axis=1) - self._bound_reductions[frame]
        kept = frontier.costs + ahead <= limit
        return _Frontier(frontier.nodes[kept], frontier.costs[kept], frontier.origin[kept])

    def _advance(self, frame: int, before: _Frontier, nodes: Ints) -> _Frontier:
        """Return the joint states `nodes` (J, n) of a frame with the cheapest predecessor of each."""
        network = self._network
        best, origin = np.full(len(nodes), np.inf), np.zeros(len(nodes), dtype=np.int64)
        leaving, entering = self._pair_offsets(frame - 1, before.nodes), self._pair_offsets(frame, nodes)
        size = max(1, _BLOCK_SIZE // max(1, len(nodes)))
        for first in range(0, len(before.nodes), size):
            part = slice(first, first + size)
            totals = network.layout * cdist(leaving[part], entering, "cityblock")
            totals += before.costs[part, None]
            for n, p in enumerate(network.pair_sets):
                totals += network.pair[p, frame - 1][before.nodes[part, n][:, None], nodes[:, n]]
            least = totals.argmin(axis=0)
            costs = totals[least, np.arange(len(nodes))]
            better = costs < best
            best[better], origin[better] = costs[better], least[better] + first
        own = network.node[np.arange(network.objects), frame, nodes].sum(axis=1)
        return _Frontier(nodes, best + own, origin)

    def _pair_offsets(self, frame: int, nodes: Ints) -> Floats:
        """Return the differences of the locations of all pairs of objects, (J, pairs * 4)."""
        locations = self._locations[np.arange(self._network.objects), frame, nodes]
        first, second = np.triu_indices(self._network.objects, 1)
        return np.asarray(
            (locations[:, first] - locations[:, second]).reshape(len(nodes), len(first) * BOX_SIDES)
        )

    def _trace_back(self, frontiers: list[_Frontier], cost: float) -> Ints | None:
        last = frontiers[-1]
        ends = last.costs + self._network.sink[np.arange(self._network.objects), last.nodes].sum(axis=1)
        if not len(ends) or not ends.min() < cost:
            return None
        at = int(ends.argmin())
        columns = []
        for frontier in reversed(frontiers):
            columns.append(frontier.nodes[at])
            at = int(frontier.origin[at])
        return np.array(columns[::-1]).T


class ExactSolver(TimedSolver):
    """Integer optimum from the relaxation and a search over what its bound does not exclude.

    With the layout term, the remaining joint states are searched by dynamic programming. Without it, or if
    they are too many, HiGHS branches and bounds over the remaining arcs: an arc is excluded if its best path,
    at the prices that prove the bound, exceeds its object's best path by more than the gap between the best
    known states and the bound.
    """

    name = "exact"

    def _solve(self, network: Network, _warm_start: WarmStart | None, meter: BudgetMeter) -> Solution:
        """Return the cheapest states without conflicts; the bound is their cost, if they are the optimum."""
        if not network.objects:
            return empty_solution(self.name, network)
        found = solve_relaxation(network, meter=meter)
        nodes = integer_nodes(network, found, meter=meter)
        proof = Certificate.of(self.name, found, meter)
        if proof.limit is None and not proof.integral:
            try:
                nodes = _integer_optimum(network, found, nodes, meter)
                proof = replace(proof, rounds=proof.rounds + 1)
            except WorkLimitError:
                proof = replace(proof, limit=meter.reached() or "work", skipped=("branch and bound",))
        if proof.limit is None:
            proof = replace(proof, bound=total_cost(network, nodes))
        return build_solution(network, nodes, replace(proof, prices=()))


def _integer_optimum(network: Network, found: RelaxedSolution, nodes: Ints, meter: BudgetMeter) -> Ints:
    """Return the cheapest states; `nodes` are states without conflicts.

    Raises:
        WorkLimitError: the meter's budget is spent before.
    """
    if network.layout:
        with suppress(TooManyStatesError):
            better = JointStateSearch(network, found, meter).cheaper_than(total_cost(network, nodes))
            return nodes if better is None else better
    return branch_and_bound(network, found, nodes, meter)


def branch_and_bound(
    network: Network, found: RelaxedSolution, nodes: Ints, meter: BudgetMeter | None = None
) -> Ints:
    """Return the cheapest states by branch and bound, first over tight arcs, then over all remaining ones.

    Raises:
        WorkLimitError: the meter's budget is spent before.
    """
    excess = arc_excess(found)
    tight = _TOLERANCE * max(1.0, abs(total_cost(network, nodes)))
    nodes = _cheaper_nodes(network, nodes, _solve_restricted(network, nodes, excess <= tight, meter))
    gap = max(0.0, total_cost(network, nodes) - found.bound) + tight
    return _cheaper_nodes(network, nodes, _solve_restricted(network, nodes, excess <= gap, meter))


def arc_excess(found: RelaxedSolution) -> Floats:
    """Return the excess cost of the best path through each arc over its object's best path, at the prices.

    Shape (n, M - 1, S, S); infinite where there is no arc.
    """
    trellis = found.priced
    forward_costs, backward_costs = forward(trellis), backward(trellis)
    least = (forward_costs[-1] + trellis.sink).min(axis=1)
    objects, frames, states = trellis.node.shape
    excess = np.empty((objects, frames - 1, states, states))
    for m in range(1, frames):
        after = (trellis.node[:, m] + backward_costs[m])[:, None]
        excess[:, m - 1] = forward_costs[m - 1][:, :, None] + trellis.pair[:, m - 1] + after
    excess -= least[:, None, None, None]
    return excess


def _solve_restricted(network: Network, nodes: Ints, allowed_arcs: Bools, meter: BudgetMeter | None) -> Ints:
    """Return the cheapest states on the allowed arcs and those of `nodes`."""
    each, steps = np.indices(nodes[:, 1:].shape)
    allowed_arcs = allowed_arcs.copy()
    allowed_arcs[each, steps, nodes[:, :-1], nodes[:, 1:]] = True
    built = build_arc_program(network, allowed_arcs)
    integer = np.zeros(len(built.program.costs), dtype=np.bool_)
    integer[built.nodes[built.nodes >= 0]] = True
    values = solve_program(built.program, integer, meter).values
    usage = np.where(built.nodes >= 0, values[built.nodes], 0.0)
    return np.asarray(usage.argmax(axis=2))


def _cheaper_nodes(network: Network, first: Ints, second: Ints) -> Ints:
    return second if total_cost(network, second) < total_cost(network, first) else first
