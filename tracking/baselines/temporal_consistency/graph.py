"""The graph of a window: every way to match people with blobs, stage by stage (section 2.1).

A node of a stage gives each person a blob; several may be in one. A link between nodes of adjacent stages
costs, for N people,

    c = 1/N (a M + sum over people of f_dist + sum over people of f_color)                            eq. (1)

*a* is the number of merged people minus the number of merges. Each person's share of a link depends only on
that person's two blobs, so the graph is stored as one small graph per person; only *a* couples them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import prod

import numpy as np
from numpy.typing import NDArray

from tracking.boxes import Floats

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class StageGraph:
    """A window of T stages after the last decided stage, for P people.

    Attributes:
        start: `(P,)`, each person's blob in the decided stage: a row of the first of `distance_costs`.
        distance_costs: T tables `(B', B)` of f_dist between the blobs of a stage and the next one.
        appearance_costs: T tables `(P, B)` of f_color.
        shared: T rows `(B,)`: whether merging there has a cost.
        merge_cost: M.
        max_step_cost: links with a higher distance cost are pruned (section 4.3); infinite: none.
    """

    start: Indices
    distance_costs: tuple[Floats, ...]
    appearance_costs: tuple[Floats, ...]
    shared: tuple[NDArray[np.bool_], ...]
    merge_cost: float
    max_step_cost: float

    @property
    def people(self) -> int:
        """The number P of people."""
        return len(self.start)


@dataclass(frozen=True, slots=True, eq=False)
class StepLinks:
    """The links of one person between two stages.

    Attributes:
        blobs: `(r,)`, the reachable blobs of the later stage, ascending.
        costs: `(r', r)`, from each reachable blob of the earlier stage, f_color included; infinite where
            there is no link.
    """

    blobs: Indices
    costs: Floats

    @property
    def count(self) -> int:
        """The number of links."""
        return int(np.isfinite(self.costs).sum())


PersonLinks = tuple[tuple[StepLinks, ...], ...]
"""For each person, their links stage by stage."""


def prune_links(graph: StageGraph) -> PersonLinks:
    """Prune the graph: keep the short links between reachable blobs.

    A person without any short link in a stage keeps all links of that stage.
    """
    return tuple(_links_of(graph, person) for person in range(graph.people))


def _links_of(graph: StageGraph, person: int) -> tuple[StepLinks, ...]:
    blobs: Indices = graph.start[person : person + 1]
    links = []
    for step, appearance in zip(graph.distance_costs, graph.appearance_costs, strict=True):
        costs = step[blobs]
        short = np.where(costs <= graph.max_step_cost, costs, np.inf)
        if np.isinf(short).all():
            short = costs
        blobs = np.flatnonzero(np.isfinite(short).any(axis=0))
        links.append(StepLinks(blobs, short[:, blobs] + appearance[person, blobs]))
    return tuple(links)


def count_joint_edges(links: Sequence[Sequence[StepLinks]]) -> list[int]:
    """Count the links between joint nodes of adjacent stages, stage by stage.

    A joint link combines one link of every person, so the counts multiply.
    """
    return [prod(step.count for step in stage) for stage in zip(*links, strict=True)]


def count_edges_without_pruning(graph: StageGraph) -> list[int]:
    """Count the links between joint nodes in the unpruned graph, stage by stage."""
    return count_joint_edges(prune_links(replace(graph, max_step_cost=np.inf)))


def merge_costs(
    blobs: Sequence[Indices], shared: NDArray[np.bool_], occupied: NDArray[np.int64], merge: float
) -> Floats:
    """Return the merge cost a M of every joint node of a stage.

    Args:
        blobs: for each of k people, the reachable blobs `(r,)`.
        shared: `(B,)`, whether merging there has a cost.
        occupied: `(B,)`, the number of other people already assigned to each blob.
        merge: M.

    Returns:
        `(r_1, ..., r_k)`, without the merge costs among the other people.
    """
    shape = tuple(len(reachable) for reachable in blobs)
    total = np.zeros(shape)
    for blob in np.flatnonzero(shared).tolist():
        candidates = [person for person, reachable in enumerate(blobs) if blob in reachable]
        if len(candidates) + int(occupied[blob] > 0) < 2:  # noqa: PLR2004 — nobody to merge with
            continue
        counts = np.zeros(shape, dtype=np.int64)
        for person in candidates:
            axis = [1] * len(shape)
            axis[person] = -1
            counts = counts + (blobs[person] == blob).astype(np.int64).reshape(axis)
        total += np.maximum(counts - (0 if occupied[blob] else 1), 0)
    return merge * total
