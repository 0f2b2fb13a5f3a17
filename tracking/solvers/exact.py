"""`exact`: the integer optimum of paper II.C, certified (their branch and bound, IV.A.4)."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from tracking.boxes import Floats
from tracking.conflicts import Bools
from tracking.network import Network
from tracking.solvers.arc_program import arc_program
from tracking.solvers.base import Solution
from tracking.solvers.columns import relaxation_by_columns
from tracking.solvers.finish import Proof, answered, nothing, whole_nodes
from tracking.solvers.highs import solve_program
from tracking.solvers.hint import Hint
from tracking.solvers.joint_search import JointSearch, TooManyStatesError
from tracking.solvers.objective import Ints, objective
from tracking.solvers.relaxed import Relaxed
from tracking.solvers.rounding import is_integral
from tracking.solvers.timed import TimedSolver
from tracking.solvers.viterbi import Trellis, backward, forward

_SLACK = 1e-9
"""Relative: excesses are sums of some tens of costs, each with its rounding error."""


class Exact(TimedSolver):
    """Fixes what the relaxation proves needless, and tries the little that is left.

    Under the layout term, joint states that the duals leave possible are tried by dynamic programming.
    Without, or where they are too many, HiGHS branches and bounds over the arcs left: one whose best
    path, at the prices that prove the bound, costs more above its object's best than the gap between the
    best states known and the bound is in no better states.
    """

    name = "exact"

    def _answer(self, network: Network, _hint: Hint | None) -> Solution:
        """Give the cheapest states without conflicts; the bound is their cost."""
        if not network.objects:
            return nothing(self.name, network)
        found = relaxation_by_columns(network)
        nodes = whole_nodes(network, found.usage)
        rounds = found.rounds
        if not is_integral(found.usage):
            nodes = _optimum(network, found, nodes)
            rounds += 1
        cost = objective(network, nodes)
        return answered(network, nodes, Proof(self.name, cost, integral=True, rounds=rounds))


def _optimum(network: Network, found: Relaxed, nodes: Ints) -> Ints:
    """Give the cheapest states; `nodes` are some without conflicts."""
    if network.layout:
        with suppress(TooManyStatesError):
            better = JointSearch(network, found).cheaper_than(objective(network, nodes))
            return nodes if better is None else better
    return by_branching(network, found, nodes)


def by_branching(network: Network, found: Relaxed, nodes: Ints) -> Ints:
    """Give the cheapest states by branch and bound, first among the arcs that are tight, then the rest."""
    excess = arc_excess(network, found)
    tight = _SLACK * max(1.0, abs(objective(network, nodes)))
    nodes = _cheaper(network, nodes, _best_among(network, nodes, excess <= tight))
    gap = max(0.0, objective(network, nodes) - found.bound) + tight
    return _cheaper(network, nodes, _best_among(network, nodes, excess <= gap))


def arc_excess(network: Network, found: Relaxed) -> Floats:
    """Give how much the best path through each arc costs above its object's best path, priced.

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


def _best_among(network: Network, nodes: Ints, allowed: Bools) -> Ints:
    """Give the cheapest states on the arcs allowed and those of `nodes`."""
    each, steps = np.indices(nodes[:, 1:].shape)
    allowed = allowed.copy()
    allowed[each, steps, nodes[:, :-1], nodes[:, 1:]] = True
    built = arc_program(network, allowed)
    whole = np.zeros(len(built.program.costs), dtype=np.bool_)
    whole[built.nodes[built.nodes >= 0]] = True
    values = solve_program(built.program, whole).values
    usage = np.where(built.nodes >= 0, values[built.nodes], 0.0)
    return np.asarray(usage.argmax(axis=2))


def _cheaper(network: Network, first: Ints, second: Ints) -> Ints:
    return second if objective(network, second) < objective(network, first) else first
