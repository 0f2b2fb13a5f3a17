"""Independent groups of people are solved separately: exponentially faster, and still exact."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod

import numpy as np

from tracking.baselines.temporal_consistency.graph import Indices, PersonLinks, WindowGraph
from tracking.baselines.temporal_consistency.per_person_search import cheapest_joint_path


@dataclass(frozen=True, slots=True, eq=False)
class JointPath:
    """The blobs of all people in the stages of a window.

    Attributes:
        blobs: `(T, P)`, the blob of each person.
        cost: eq. (1), summed over the stages.
        exact: no path costs less. It is not where more people may meet than `most_states` allows for.
    """

    blobs: Indices
    cost: float
    exact: bool


def solve_joint_path(graph: WindowGraph, found: PersonLinks, most_states: int) -> JointPath:
    """Find the joint path of all people; `found` are the graph's pruned links.

    Only merges tie people together, so those who share no blob they might be in at one time are apart. Of too
    many who are not, the first are decided together, and then the others beside them.
    """
    stages, people = len(graph.distance_costs), graph.people
    blobs = np.zeros((stages, people), dtype=np.int64)
    taken = [np.zeros(len(it), dtype=np.int64) for it in graph.shared]
    cost, exact = 0.0, True
    for group in _meeting(graph, found):
        rest = group
        while rest:
            now = _fitting(found, rest, most_states)
            part, spent = cheapest_joint_path(
                [found[it] for it in now], graph.shared, taken, graph.merge_cost
            )
            blobs[:, now] = part
            cost += spent
            for row in range(stages):
                np.add.at(taken[row], part[row], 1)
            rest = rest[len(now) :]
            exact = exact and not rest
    return JointPath(blobs, cost / max(people, 1), exact)


def _meeting(graph: WindowGraph, found: PersonLinks) -> list[list[int]]:
    """Group the people who may share a blob in any stage, ordered by their first member."""
    group = list(range(graph.people))
    for row, shared in enumerate(graph.shared):
        first: dict[int, int] = {}
        for person in range(graph.people):
            for blob in found[person][row].blobs.tolist():
                if not shared[blob]:
                    continue
                other = group[first.setdefault(blob, person)]
                mine = group[person]
                if mine != other:
                    low, high = sorted((mine, other))
                    group = [low if it == high else it for it in group]
    return [[person for person, it in enumerate(group) if it == name] for name in sorted(set(group))]


def _fitting(found: PersonLinks, people: list[int], most_states: int) -> list[int]:
    """Return the longest prefix of `people` with few enough joint states, at least one person."""
    for count in range(len(people), 1, -1):
        stages = zip(*(found[it] for it in people[:count]), strict=True)
        if max(prod(len(links.blobs) for links in stage) for stage in stages) <= most_states:
            return people[:count]
    return people[:1]
