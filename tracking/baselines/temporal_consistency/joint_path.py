"""The cheapest joint path of all people through a window's graph.

Independent groups of people are solved separately, and within a stage the search goes person by person:

    V_t(b_1 .. b_k) = a M + min over b' of ( V_(t-1)(b'_1 .. b'_k) + sum over p of c_p(b'_p, b_p) )

The costs of a step are a sum over people, so the minimum over all earlier nodes is computed for one person's
blob after another: k b^(k+1) sums per stage instead of the b^(2k) of section 2.2. Both are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

import numpy as np
from numpy.typing import NDArray

from tracking.baselines.temporal_consistency.graph import (
    Indices,
    PersonLinks,
    StageGraph,
    StepLinks,
    merge_costs,
)
from tracking.boxes import Floats


@dataclass(frozen=True, slots=True, eq=False)
class JointPath:
    """The blobs of all people in the stages of a window.

    Attributes:
        blobs: `(T, P)`, the blob of each person.
        cost: eq. (1), summed over the stages.
        exact: whether no path costs less; False if a group exceeds `most_states` joint states.
    """

    blobs: Indices
    cost: float
    exact: bool


def solve_joint_path(graph: StageGraph, links: PersonLinks, most_states: int) -> JointPath:
    """Find the joint path of all people; `links` are the graph's pruned links.

    Only merges couple people, so those who can share no blob in any stage are independent. A group that is
    too large is solved in parts, each given those before it.
    """
    stages, people = len(graph.distance_costs), graph.people
    blobs = np.zeros((stages, people), dtype=np.int64)
    occupied = [np.zeros(len(shared), dtype=np.int64) for shared in graph.shared]
    cost, exact = 0.0, True
    for group in _groups(graph, links):
        rest = group
        while rest:
            members = _largest_part(links, rest, most_states)
            path, part_cost = cheapest_joint_path(
                [links[person] for person in members], graph.shared, occupied, graph.merge_cost
            )
            blobs[:, members] = path
            cost += part_cost
            for row in range(stages):
                np.add.at(occupied[row], path[row], 1)
            rest = rest[len(members) :]
            exact = exact and not rest
    return JointPath(blobs, cost / max(people, 1), exact)


def _groups(graph: StageGraph, links: PersonLinks) -> list[list[int]]:
    """Group the people who may share a blob in any stage, ordered by their first member."""
    group = list(range(graph.people))
    for row, shared in enumerate(graph.shared):
        first: dict[int, int] = {}
        for person in range(graph.people):
            for blob in links[person][row].blobs.tolist():
                if not shared[blob]:
                    continue
                other = group[first.setdefault(blob, person)]
                current = group[person]
                if current != other:
                    low, high = sorted((current, other))
                    group = [low if label == high else label for label in group]
    return [
        [person for person, member_of in enumerate(group) if member_of == label]
        for label in sorted(set(group))
    ]


def _largest_part(links: PersonLinks, people: list[int], most_states: int) -> list[int]:
    """Return the longest prefix of `people` with few enough joint states, at least one person."""
    for count in range(len(people), 1, -1):
        stages = zip(*(links[person] for person in people[:count]), strict=True)
        if max(prod(len(step.blobs) for step in stage) for stage in stages) <= most_states:
            return people[:count]
    return people[:1]


def cheapest_joint_path(
    links: Sequence[Sequence[StepLinks]],
    shared: Sequence[NDArray[np.bool_]],
    occupied: Sequence[NDArray[np.int64]],
    merge: float,
) -> tuple[Indices, float]:
    """Find the best path of k people through T stages.

    Args:
        links: the links of each person, stage by stage.
        shared: T rows `(B,)`, whether merging there has a cost.
        occupied: T rows `(B,)`, the number of other people already assigned to each blob.
        merge: M.

    Returns:
        `(T, k)` blobs, the lowest of equally good ones, and the path's cost, infinite if there is no path.
    """
    value = np.zeros((1,) * len(links))
    trace: list[list[Indices]] = []
    stages = list(zip(*links, strict=True))
    for stage, free, others in zip(stages, shared, occupied, strict=True):
        chosen = []
        for person, step in enumerate(stage):
            value, best = _step(value, person, step.costs)
            chosen.append(best)
        value = value + merge_costs([step.blobs for step in stage], free, others, merge)
        trace.append(chosen)
    at = [int(index) for index in np.unravel_index(int(value.argmin()), value.shape)]
    cost = float(value[tuple(at)])
    path = np.empty((len(stages), len(links)), dtype=np.int64)
    for row in range(len(stages) - 1, -1, -1):
        path[row] = [step.blobs[index] for step, index in zip(stages[row], at, strict=True)]
        # The minimum of the last person was computed when the others had their new blobs already.
        for person in range(len(links) - 1, -1, -1):
            at[person] = int(trace[row][person][tuple(at)])
    return path, cost


def _step(value: Floats, axis: int, costs: Floats) -> tuple[Floats, Indices]:
    """Advance one person: replace the axis of the old blob (length r') by that of the new one (length r)."""
    sums = np.moveaxis(value, axis, -1)[..., None] + costs
    best = sums.argmin(axis=-2)
    least = np.take_along_axis(sums, best[..., None, :], axis=-2)[..., 0, :]
    return np.moveaxis(least, -1, axis), np.moveaxis(best, -1, axis)


def cheapest_path_by_edges(
    links: Sequence[Sequence[StepLinks]], shared: Sequence[NDArray[np.bool_]], merge: float
) -> tuple[Indices, float]:
    """Find the best path along every joint link (section 2.1): the reference for `cheapest_joint_path`."""
    people = len(links)
    value = np.zeros(1)
    before = np.zeros((1, people), dtype=np.int64)
    trace: list[tuple[Indices, Indices]] = []
    for stage, free in zip(zip(*links, strict=True), shared, strict=True):
        nodes = np.array(list(product(*(range(len(step.blobs)) for step in stage))), dtype=np.int64)
        sums = value[:, None] + np.zeros(len(nodes))
        for person, step in enumerate(stage):
            sums += step.costs[before[:, person][:, None], nodes[:, person]]
        best = sums.argmin(axis=0)
        unoccupied = np.zeros(len(free), dtype=np.int64)
        merges = merge_costs([step.blobs for step in stage], free, unoccupied, merge).ravel()
        value = sums[best, np.arange(len(nodes))] + merges
        blobs = np.stack([step.blobs[nodes[:, person]] for person, step in enumerate(stage)], axis=-1)
        trace.append((blobs, best))
        before = nodes
    at = int(value.argmin())
    cost, path = float(value[at]), np.empty((len(trace), people), dtype=np.int64)
    for row in range(len(trace) - 1, -1, -1):
        blobs, best = trace[row]
        path[row], at = blobs[at], int(best[at])
    return path, cost
