"""The independent parts of a program: people who share no place, and no two places that exclude each other.

Two objects have to do with each other only if they can take the same place, or two places of a frame of which
only one can be taken. Whom a place can lead to belongs to its part, and so do the newcomers who can arrive
there: those of one part are nobody of another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tracking.boxes import BOX_SIDES
from tracking.ground_plane.program.costs import Ints, MoveArcs, ProgramCosts
from tracking.model.network import Network


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A part of a program.

    Attributes:
        people: (N,) rows of the known people in it, ascending.
        places: of each frame, (K,), ascending.
        arrivals: the number of arcs by which newcomers can arrive.
        costs: the costs of these people and places, numbered within the part.
        conflicts: (K, K) of each frame, places of which only one can be taken.
    """

    people: Ints
    places: tuple[Ints, ...]
    arrivals: int
    costs: ProgramCosts
    conflicts: tuple[NDArray[np.bool_], ...]


def divide(costs: ProgramCosts, conflicts: Sequence[NDArray[np.bool_]]) -> list[Part]:
    """Return the parts of a program that have places; `conflicts` (K, K) are those of each frame.

    Known people in none of them are seen nowhere. Parts are in the order of their first known person, then of
    their first place.
    """
    used = _used_places(costs)
    first = np.cumsum([0, *(len(each) for each in used)])
    people, total = costs.people, int(first[-1])
    pairs = [np.zeros((2, 0), dtype=np.int64)]
    for m, (begin, end) in enumerate(pairwise(first.tolist())):
        row, place = np.nonzero(np.isfinite(costs.reach[m][:people]))
        pairs.append(np.stack([row, people + begin + place]))
        pairs.append(people + begin + np.array(np.nonzero(conflicts[m] & used[m] & used[m][:, None])))
        if m < len(costs.steps):
            arcs = costs.steps[m]
            pairs.append(people + np.stack([begin + arcs.origin, end + arcs.target]))
    one, other = np.concatenate(pairs, axis=1)
    size = people + total
    graph = coo_array((np.ones(len(one), dtype=np.bool_), (one, other)), shape=(size, size))
    labels = np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
    of_people, of_places = labels[:people], [labels[people + a : people + b] for a, b in pairwise(first)]
    masked = [np.where(each, label, -1) for each, label in zip(used, of_places, strict=True)]
    found = np.unique(np.concatenate([label[each] for each, label in zip(used, of_places, strict=True)]))
    split = _Split(costs, conflicts, of_people, masked)
    return [split.part(label) for label in found.tolist()]


def _used_places(costs: ProgramCosts) -> list[NDArray[np.bool_]]:
    """Return which places of each frame anybody can take."""
    used = [np.asarray(np.isfinite(entering).any(axis=0)) for entering in costs.reach]
    for m, arcs in enumerate(costs.steps):
        used[m + 1][arcs.target] = True
    return used


class _Split:
    """Sorts everything by part once, so that each part takes its own only."""

    def __init__(
        self,
        costs: ProgramCosts,
        conflicts: Sequence[NDArray[np.bool_]],
        of_people: Ints,
        of_places: Sequence[Ints],
    ) -> None:
        self._costs, self._conflicts = costs, conflicts
        self._people = _Groups(of_people)
        self._places = [_Groups(labels) for labels in of_places]
        self._arcs = [
            _Groups(labels[arcs.origin]) for labels, arcs in zip(of_places[:-1], costs.steps, strict=True)
        ]
        self._local_row = np.append(self._people.ranks, 0)
        self._local_places = [groups.ranks for groups in self._places]

    def part(self, label: int) -> Part:
        """Return the part with a label."""
        costs = self._costs
        people = self._people.members(label)
        places = tuple(groups.members(label) for groups in self._places)
        rows = np.append(people, costs.people)
        steps = []
        for m, arcs in enumerate(costs.steps):
            chosen = self._arcs[m].members(label)
            row = arcs.row[chosen]
            steps.append(
                MoveArcs(
                    np.where(row == costs.people, len(people), self._local_row[row]),
                    self._local_places[m][arcs.origin[chosen]],
                    self._local_places[m + 1][arcs.target[chosen]],
                    arcs.cost[chosen],
                )
            )
        reach = tuple(entering[np.ix_(rows, at)] for entering, at in zip(costs.reach, places, strict=True))
        return Part(
            people,
            places,
            sum(int(np.isfinite(entering[-1]).sum()) for entering in reach),
            ProgramCosts(
                costs.hidden[rows],
                costs.leave,
                tuple(node[np.ix_(rows, at)] for node, at in zip(costs.node, places, strict=True)),
                reach,
                tuple(steps),
            ),
            tuple(each[np.ix_(at, at)] for each, at in zip(self._conflicts, places, strict=True)),
        )


class _Groups:
    """The indices with each label, ascending, and the rank of each index among those with its label."""

    def __init__(self, labels: Ints) -> None:
        self._order = np.argsort(labels, kind="stable")
        self._sorted = labels[self._order]
        self.ranks = np.empty(len(labels), dtype=np.int64)
        begins = np.searchsorted(self._sorted, self._sorted)
        self.ranks[self._order] = np.arange(len(labels)) - begins

    def members(self, label: int) -> Ints:
        """Return the indices with a label."""
        begin, end = np.searchsorted(self._sorted, [label, label + 1])
        return np.asarray(self._order[begin:end])


def part_network(part: Part, newcomers: int) -> Network:
    """Return the network of a part, in the form that all solvers take (paper II.B).

    Its objects are the known people and so many newcomers. The last place of every frame is being gone, which
    any number can take.
    """
    costs, known = part.costs, len(part.people)
    objects, length = known + newcomers, len(part.places)
    gone = max(len(places) for places in part.places)
    hidden = gone + 1
    # The row of each object: newcomers share the last one.
    rows = np.minimum(np.arange(objects), known)
    node = np.full((objects, length, hidden + 1), np.inf)
    source = np.full((objects, hidden + 1), np.inf)
    pair = np.full((known + 1, length - 1, hidden + 1, hidden + 1), np.inf)
    node[:, :, hidden] = costs.hidden[rows]
    node[:, :, gone] = 0.0
    source[:, hidden] = 0.0
    source[:known, gone] = pair[:known, :, hidden, gone] = costs.leave
    pair[:, :, :gone, gone] = costs.leave
    pair[:known, :, :gone, hidden] = 0.0
    pair[:, :, gone, gone] = pair[:, :, hidden, hidden] = 0.0
    for m, places in enumerate(part.places):
        node[:, m, : len(places)] = costs.node[m][rows]
        if m == 0:
            source[:, : len(places)] = costs.reach[m][rows]
        else:
            arcs = costs.steps[m - 1]
            pair[:, m - 1, hidden, : len(places)] = costs.reach[m]
            pair[arcs.row, m - 1, arcs.origin, arcs.target] = arcs.cost
    boxes = np.zeros((1, length, gone + 1, BOX_SIDES))
    present = np.zeros((1, length, gone + 1), dtype=np.bool_)
    present[:, :, gone] = True
    conflicts = np.zeros((length, gone + 1, gone + 1), dtype=np.bool_)
    for m, found in enumerate(part.conflicts):
        present[0, m, : len(found)] = True
        conflicts[m, : len(found), : len(found)] = found
    return Network(
        boxes=boxes,
        present=present,
        source=source,
        node=node,
        pair=pair[rows],
        sink=np.zeros((objects, hidden + 1)),
        conflicts=conflicts,
        conflict_rows="clique",
        locations=np.zeros((1, length, hidden + 1, BOX_SIDES)),
        layout=0.0,
    )
