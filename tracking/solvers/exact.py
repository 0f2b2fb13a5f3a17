"""Dynamic programming over the joint states that a proof leaves: the layout term's integer optimum.

The extended dynamic program (I.A) has S^n joint states a frame. The duals of the relaxation say what
the rest of the window costs at least from each of them, and most joint states cost more with that than an
answer already known.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from tracking.boxes import BOX_SIDES, Floats
from tracking.model.conflicts import Bools
from tracking.model.network import Network
from tracking.solvers.arc_program import build_arc_program
from tracking.solvers.base import Solution, TimedSolver
from tracking.solvers.column_generation import solve_relaxation
from tracking.solvers.linear_program import solve_program
from tracking.solvers.objective import Ints, total_cost
from tracking.solvers.relaxation import RelaxedSolution
from tracking.solvers.rounding import is_integral
from tracking.solvers.solution_builder import Certificate, build_solution, empty_solution, integer_nodes
from tracking.solvers.viterbi import MinMarginals, Trellis, backward, forward
from tracking.solvers.warm_start import WarmStart

_MAX_JOINT_STATES = 150_000
"""Joint states of a frame."""

_MAX_TRANSITIONS = 2_000_000_000
"""Pairs of joint states of two frames, over the whole window: about half a minute."""

_BLOCK_SIZE = 2_000_000
"""Numbers held at once, 16 MB."""

_TOLERANCE = 1e-9
"""Relative: bounds are sums of some tens of costs, each with its rounding error."""


class TooManyStatesError(Exception):
    """The proof leaves more than can be tried."""


@dataclass(frozen=True, slots=True, eq=False)
class _Frontier:
    """Joint states of a frame: `nodes` (J, n), the `costs` (J,) to get there, and from which, `origin`."""

    nodes: Ints
    costs: Floats
    origin: Ints


class JointStateSearch:
    """Searches a network with layout term whose relaxation is solved, its duals known."""

    def __init__(self, network: Network, found: RelaxedSolution) -> None:
        self._network = network
        self._bound = found.bound
        self._exclusions = network.exclusions()
        passes = MinMarginals.of(Trellis.of(network).with_node(found.priced))
        self._excess = passes.through - passes.least[:, None, None]
        self._where = network.locations[network.sets]
        # What the way from a state on costs at least: the part of a pull that acts at the cut is undone.
        self._rest = np.swapaxes(passes.backward, 0, 1).copy()
        self._rest[:, :-1] += np.einsum("nml,nmsl->nms", found.layout_prices, self._where[:, :-1])
        self._charges = np.append(np.cumsum(found.charges[::-1])[::-1][1:], 0.0)

    def cheaper_than(self, cost: float) -> Ints | None:
        """Return the cheapest nodes (n, M) if they cost less than `cost`; None: nothing does.

        Raises:
            TooManyStatesError: finding out would take too long.
        """
        limit = cost + _TOLERANCE * max(1.0, abs(cost))
        network = self._network
        nodes = self._candidates(0, limit)
        costs = (network.source + network.node[:, 0])[np.arange(network.objects), nodes].sum(axis=1)
        frontiers = [self._hopeful(0, _Frontier(nodes, costs, np.zeros(len(nodes), np.int64)), limit)]
        steps = 0
        for m in range(1, network.frames):
            nodes = self._candidates(m, limit)
            steps += len(nodes) * len(frontiers[-1].nodes)
            if steps > _MAX_TRANSITIONS:
                raise TooManyStatesError
            frontiers.append(self._hopeful(m, self._arrived(m, frontiers[-1], nodes), limit))
        return self._traced(frontiers, cost)

    def _candidates(self, frame: int, limit: float) -> Ints:
        """Return the joint states (J, n) without conflicts that the bound leaves possible."""
        network = self._network
        joint, excess = np.empty((1, 0), dtype=np.int64), np.zeros(1)
        for n in range(network.objects):
            own = np.flatnonzero(self._excess[n, frame] <= limit - self._bound)
            total = excess[:, None] + self._excess[n, frame, own]
            fits = total <= limit - self._bound
            for other in range(n):
                fits &= ~self._barred(frame, (other, n))[np.ix_(joint[:, other], own)]
            first, second = np.nonzero(fits)
            if len(first) > _MAX_JOINT_STATES:
                raise TooManyStatesError
            joint = np.column_stack([joint[first], own[second]])
            excess = total[first, second]
        return joint

    def _barred(self, frame: int, pair: tuple[int, int]) -> Bools:
        """Return which states of two objects conflict, (S, S)."""
        places, sets = self._network.places, self._network.sets
        barred = np.zeros((places + 1, places + 1), dtype=np.bool_)
        first, second = (slice(sets[n] * places, (sets[n] + 1) * places) for n in pair)
        barred[:places, :places] = self._exclusions[frame, first, second]
        return barred

    def _hopeful(self, frame: int, frontier: _Frontier, limit: float) -> _Frontier:
        """Leave out joint states from which no answer is as cheap as the limit."""
        each = np.arange(self._network.objects)
        rest = self._rest[each, frame, frontier.nodes].sum(axis=1) - self._charges[frame]
        kept = frontier.costs + rest <= limit
        return _Frontier(frontier.nodes[kept], frontier.costs[kept], frontier.origin[kept])

    def _arrived(self, frame: int, before: _Frontier, nodes: Ints) -> _Frontier:
        """Return the cheapest way into each of the joint states `nodes` (J, n) of a frame."""
        network = self._network
        best, origin = np.full(len(nodes), np.inf), np.zeros(len(nodes), dtype=np.int64)
        leaving, entering = self._apart(frame - 1, before.nodes), self._apart(frame, nodes)
        size = max(1, _BLOCK_SIZE // max(1, len(nodes)))
        for first in range(0, len(before.nodes), size):
            part = slice(first, first + size)
            ways = network.layout * cdist(leaving[part], entering, "cityblock")
            ways += before.costs[part, None]
            for n, p in enumerate(network.pair_sets):
                ways += network.pair[p, frame - 1][before.nodes[part, n][:, None], nodes[:, n]]
            least = ways.argmin(axis=0)
            costs = ways[least, np.arange(len(nodes))]
            better = costs < best
            best[better], origin[better] = costs[better], least[better] + first
        own = network.node[np.arange(network.objects), frame, nodes].sum(axis=1)
        return _Frontier(nodes, best + own, origin)

    def _apart(self, frame: int, nodes: Ints) -> Floats:
        """Return the differences of the locations of all pairs of objects, (J, pairs * 4)."""
        where = self._where[np.arange(self._network.objects), frame, nodes]
        first, second = np.triu_indices(self._network.objects, 1)
        return np.asarray((where[:, first] - where[:, second]).reshape(len(nodes), len(first) * BOX_SIDES))

    def _traced(self, frontiers: list[_Frontier], cost: float) -> Ints | None:
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


"""Relative: excesses are sums of some tens of costs, each with its rounding error."""


class ExactSolver(TimedSolver):
    """Fixes what the relaxation proves needless, and tries the little that is left.

    Under the layout term, joint states that the duals leave possible are tried by dynamic programming.
    Without, or where they are too many, HiGHS branches and bounds over the arcs left: one whose best
    path, at the prices that prove the bound, costs more above its object's best than the gap between the
    best states known and the bound is in no better states.
    """

    name = "exact"

    def _solve(self, network: Network, _warm_start: WarmStart | None) -> Solution:
        """Return the cheapest states without conflicts; the bound is their cost."""
        if not network.objects:
            return empty_solution(self.name, network)
        found = solve_relaxation(network)
        nodes = integer_nodes(network, found.usage)
        rounds = found.rounds
        if not is_integral(found.usage):
            nodes = _integer_optimum(network, found, nodes)
            rounds += 1
        cost = total_cost(network, nodes)
        return build_solution(network, nodes, Certificate(self.name, cost, integral=True, rounds=rounds))


def _integer_optimum(network: Network, found: RelaxedSolution, nodes: Ints) -> Ints:
    """Return the cheapest states; `nodes` are some without conflicts."""
    if network.layout:
        with suppress(TooManyStatesError):
            better = JointStateSearch(network, found).cheaper_than(total_cost(network, nodes))
            return nodes if better is None else better
    return branch_and_bound(network, found, nodes)


def branch_and_bound(network: Network, found: RelaxedSolution, nodes: Ints) -> Ints:
    """Return the cheapest states by branch and bound, first among the arcs that are tight, then the rest."""
    excess = arc_excess(network, found)
    tight = _TOLERANCE * max(1.0, abs(total_cost(network, nodes)))
    nodes = _cheaper_nodes(network, nodes, _solve_restricted(network, nodes, excess <= tight))
    gap = max(0.0, total_cost(network, nodes) - found.bound) + tight
    return _cheaper_nodes(network, nodes, _solve_restricted(network, nodes, excess <= gap))


def arc_excess(network: Network, found: RelaxedSolution) -> Floats:
    """Return how much the best path through each arc costs above its object's best path, priced.

    Shape (n, M - 1, S, S); infinite where there is no arc.
    """
    trellis = Trellis.of(network).with_node(found.priced)
    ahead, behind = forward(trellis), backward(trellis)
    least = (ahead[-1] + trellis.sink).min(axis=1)
    objects, frames, states = network.node.shape
    excess = np.empty((objects, frames - 1, states, states))
    for m in range(1, frames):
        rest = (trellis.node[:, m] + behind[m])[:, None]
        excess[:, m - 1] = ahead[m - 1][:, :, None] + trellis.pair[:, m - 1] + rest
    excess -= least[:, None, None, None]
    return excess


def _solve_restricted(network: Network, nodes: Ints, allowed: Bools) -> Ints:
    """Return the cheapest states on the arcs allowed and those of `nodes`."""
    each, steps = np.indices(nodes[:, 1:].shape)
    allowed = allowed.copy()
    allowed[each, steps, nodes[:, :-1], nodes[:, 1:]] = True
    built = build_arc_program(network, allowed)
    whole = np.zeros(len(built.program.costs), dtype=np.bool_)
    whole[built.nodes[built.nodes >= 0]] = True
    values = solve_program(built.program, whole).values
    usage = np.where(built.nodes >= 0, values[built.nodes], 0.0)
    return np.asarray(usage.argmax(axis=2))


def _cheaper_nodes(network: Network, first: Ints, second: Ints) -> Ints:
    return second if total_cost(network, second) < total_cost(network, first) else first
