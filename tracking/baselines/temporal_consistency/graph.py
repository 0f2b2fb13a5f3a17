"""The graph of a window: every way to match people with blobs, stage by stage (section 2.1).

A node of a stage gives each person a blob; several may be in one. A link between nodes of adjacent stages
costs, with N people,

    c = 1/N (a M + sum over people of f_dist + sum over people of f_color)                            eq. (1)

*a* is how many people are merged less the number of merges. Each person's part of a link depends on their own
two blobs only, so the graph is kept as one small graph a person; what ties them together is *a*.
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
class WindowGraph:
    """A window of T stages after the last decided stage, for P people.

    Attributes:
        start: `(P,)`, everybody's blob in the decided stage, an index of the first of `steps`' rows.
        distance_costs: T tables `(B', B)` of f_dist between the blobs of a stage and the next one.
        appearance_costs: T tables `(P, B)` of f_color.
        shared: T rows `(B,)`: whether it costs something to be several there.
        merge_cost: M.
        max_step_cost: steps that cost more are no links (section 4.3); infinite: none is left out.
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
class Links:
    """The links of one person between two stages.

    Attributes:
        blobs: `(r,)`, the later stage's blobs that they may be in, ascending.
        costs: `(r', r)`, from each blob of the stage before that they may be in, f_color included; infinite
            where there is no link.
    """

    blobs: Indices
    costs: Floats

    @property
    def count(self) -> int:
        """The number of links."""
        return int(np.isfinite(self.costs).sum())


PersonLinks = tuple[tuple[Links, ...], ...]
"""For each person, their links stage by stage."""


def prune_links(graph: WindowGraph) -> PersonLinks:
    """Prune the graph: keep the links that are short enough between reachable blobs.

    A person for whom none is left at a stage keeps all of that stage: they must be somewhere.
    """
    return tuple(_ways_of(graph, person) for person in range(graph.people))


def _ways_of(graph: WindowGraph, person: int) -> tuple[Links, ...]:
    at: Indices = graph.start[person : person + 1]
    found = []
    for step, looks in zip(graph.distance_costs, graph.appearance_costs, strict=True):
        costs = step[at]
        short = np.where(costs <= graph.max_step_cost, costs, np.inf)
        if np.isinf(short).all():
            short = costs
        at = np.flatnonzero(np.isfinite(short).any(axis=0))
        found.append(Links(at, short[:, at] + looks[person, at]))
    return tuple(found)


def count_joint_edges(found: Sequence[Sequence[Links]]) -> list[int]:
    """Count the links between joint nodes of adjacent stages, stage by stage.

    A joint link is one of every person's, so their numbers multiply.
    """
    return [prod(links.count for links in stage) for stage in zip(*found, strict=True)]


def count_unpruned_edges(graph: WindowGraph) -> list[int]:
    """Count the links between joint nodes in the unpruned graph, stage by stage."""
    return count_joint_edges(prune_links(replace(graph, max_step_cost=np.inf)))


def merge_costs(
    blobs: Sequence[Indices], shared: NDArray[np.bool_], taken: NDArray[np.int64], merge: float
) -> Floats:
    """Return the merge cost a M of every joint node of a stage.

    Args:
        blobs: for each of k people, the `(r,)` blobs that they may be in.
        shared: `(B,)`, whether it costs something to be several there.
        taken: `(B,)`, how many others are there already.
        merge: M.

    Returns:
        `(r_1, ..., r_k)`; what the others cost among themselves is not in it.
    """
    shape = tuple(len(it) for it in blobs)
    total = np.zeros(shape)
    for blob in np.flatnonzero(shared).tolist():
        met = [person for person, it in enumerate(blobs) if blob in it]
        if len(met) + int(taken[blob] > 0) < 2:  # noqa: PLR2004 — nobody to be with
            continue
        here = np.zeros(shape, dtype=np.int64)
        for person in met:
            axis = [1] * len(shape)
            axis[person] = -1
            here = here + (blobs[person] == blob).astype(np.int64).reshape(axis)
        total += np.maximum(here - (0 if taken[blob] else 1), 0)
    return merge * total
