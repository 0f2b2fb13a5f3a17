"""Leaves out of the program what no optimum needs.

Whoever is hidden, or gone, is in nobody's way. So a path that costs as much as the cheapest of its object
without any place can be exchanged for that one, and an arc on no cheaper path can be left out: in the integer
program, and in its relaxation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tracking.boxes import Floats
from tracking.ground_plane.program.costs import Ints, ProgramCosts

GONE, HIDDEN = -2, -1
"""States of somebody who is at no place."""


@dataclass(frozen=True, slots=True, eq=False)
class UnseenPaths:
    """The cheapest path of each row without any place.

    Attributes:
        costs: (R,).
        states: (R, M) `HIDDEN` or `GONE`.
    """

    costs: Floats
    states: Ints


def unseen_paths(costs: ProgramCosts) -> UnseenPaths:
    """Return the cheapest paths on which nobody sees the people; newcomers do not arrive."""
    rows, frames = costs.hidden.shape
    ends = np.concatenate([np.zeros((rows, 1)), np.cumsum(costs.hidden, axis=1)], axis=1)
    ends[:, :-1] += costs.leave
    hidden = ends.argmin(axis=1)
    hidden[costs.people] = frames
    states = np.where(np.arange(frames) < hidden[:, None], HIDDEN, GONE)
    return UnseenPaths(ends[np.arange(rows), hidden], states)


def useful_arcs(costs: ProgramCosts, unseen: UnseenPaths) -> ProgramCosts:
    """Return the program without the arcs that are on no path cheaper than the unseen one."""
    ahead, hidden_ahead = _forward(costs)
    onward = _backward(costs)
    reach = []
    for m, entering in enumerate(costs.reach):
        hidden = hidden_ahead[:, m - 1, None] if m else 0.0
        through = hidden + entering + costs.node[m] + onward[m]
        reach.append(np.where(through < unseen.costs[:, None], entering, np.inf))
    steps = []
    for m, arcs in enumerate(costs.steps):
        through = ahead[m][arcs.row, arcs.origin] + arcs.cost
        through += (costs.node[m + 1] + onward[m + 1])[arcs.row, arcs.target]
        steps.append(arcs.select(through < unseen.costs[arcs.row]))
    return replace(costs, reach=tuple(reach), steps=tuple(steps))


def _forward(costs: ProgramCosts) -> tuple[list[Floats], Floats]:
    """Return the costs of the cheapest paths to each place of each frame (R, K), and to hidden (R, M)."""
    may_hide = costs.may_hide()
    hidden = np.empty_like(costs.hidden)
    hidden[:, 0] = costs.hidden[:, 0]
    found = [costs.reach[0] + costs.node[0]]
    for m, arcs in enumerate(costs.steps):
        best = hidden[:, m, None] + costs.reach[m + 1]
        np.minimum.at(best, (arcs.row, arcs.target), found[m][arcs.row, arcs.origin] + arcs.cost)
        found.append(best + costs.node[m + 1])
        left = np.where(may_hide, found[m].min(axis=1, initial=np.inf), np.inf)
        hidden[:, m + 1] = costs.hidden[:, m + 1] + np.minimum(hidden[:, m], left)
    return found, hidden


def _backward(costs: ProgramCosts) -> list[Floats]:
    """Return the costs of the cheapest paths from each place (R, K) of each frame, without its own."""
    may_hide = costs.may_hide()
    hidden = np.zeros(len(costs.hidden))
    found = [np.zeros_like(node) for node in costs.node]
    for m in range(len(costs.steps) - 1, -1, -1):
        arcs, after = costs.steps[m], costs.node[m + 1] + found[m + 1]
        stay = costs.hidden[:, m + 1] + hidden
        found[m][:] = np.where(may_hide, np.minimum(stay, costs.leave), costs.leave)[:, None]
        np.minimum.at(found[m], (arcs.row, arcs.origin), arcs.cost + after[arcs.row, arcs.target])
        seen = (costs.reach[m + 1] + after).min(axis=1, initial=np.inf)
        hidden = np.minimum(np.where(may_hide, np.minimum(stay, costs.leave), stay), seen)
    return found
