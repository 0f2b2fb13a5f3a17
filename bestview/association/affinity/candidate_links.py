"""Who is asked about together: rows between which something speaks for one person, and chains of these."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from bestview.association.affinity.evidence import Evidence
from bestview.association.appearance.likelihood import CameraLooks, LookWeights
from bestview.association.index_ranges import pairs_within

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_BATCH = 64
"""Rows that are worth grouping at once: fewer cost as much."""


@dataclass(frozen=True, slots=True, eq=False)
class Links:
    """P pairs of N rows for whose being one person something speaks, the lower row first, rising.

    Attributes:
        one: (P,) open episodes.
        two: (P,) episodes or people.
        rows: N.
    """

    one: Ints
    two: Ints
    rows: int

    @classmethod
    def found(
        cls, evidence: Evidence, looks: Sequence[CameraLooks], weights: LookWeights, episodes: int, rows: int
    ) -> Links:
        """Find the pairs with evidence above 0, one of which at least is among the first `episodes` rows.

        Args:
            evidence: of everything but looks.
            looks: camera by camera; an episode has them in one only.
            weights: of looks.
            episodes: how many rows are open.
            rows: how many there are.
        """
        one, two = evidence.spoken_for()
        value = np.zeros(one.size)
        more = [one * rows + two]
        worth = [value]
        place = np.full(rows, -1)
        for camera in looks:
            place[camera.rows] = np.arange(camera.rows.size)
            alike = np.triu(camera.every(weights, int(np.searchsorted(camera.rows, episodes))), 1)
            a, b = place[one], place[two]
            known = (a >= 0) & (b >= 0)
            value[known] = alike[a[known], b[known]]
            a, b = np.nonzero(alike > 0)
            more.append(camera.rows[a] * rows + camera.rows[b])
            worth.append(alike[a, b])
            place[camera.rows] = -1
        pairs, at = np.unique(np.concatenate(more), return_index=True)
        one, two = pairs // max(rows, 1), pairs % max(rows, 1)
        rest, apart = evidence.of(one, two)
        linked = (np.concatenate(worth)[at] + rest > 0) & ~apart
        return cls(one[linked], two[linked], rows)

    def chained(self) -> Ints:
        """Give which rows chains of links lead to each other: (N,) the number of the chain, -1: no link."""
        graph = scipy.sparse.coo_array(
            (np.ones(self.one.size), (self.one, self.two)), shape=(self.rows, self.rows)
        )
        _, chain = scipy.sparse.csgraph.connected_components(graph, directed=False)
        chain = chain.astype(np.int64)
        linked = np.zeros(self.rows, dtype=np.bool_)
        linked[self.one] = linked[self.two] = True
        return np.where(linked, chain, -1)


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """What is known of N rows between which and all others there is no link.

    Attributes:
        rows: (N,) rising.
        evidence: (N, N) symmetric, of everything but looks; 0 between rows that no chain of links joins.
        apart: (N, N) likewise, surely two people.
        linked: (N, N) symmetric.
        looks: camera by camera; their rows are places in `rows`.
    """

    rows: Ints
    evidence: Floats
    apart: NDArray[np.bool_]
    linked: NDArray[np.bool_]
    looks: list[CameraLooks]


def batches(
    links: Links, evidence: Evidence, looks: Sequence[CameraLooks], least: int = _BATCH
) -> list[Batch]:
    """Part the rows that have links, such that no link is lost; whole chains of them go together.

    Args:
        links: between rows.
        evidence: of everything but looks.
        looks: camera by camera.
        least: rows to put together, as long as there are so many.
    """
    chain = links.chained()
    parts = _packed(chain, least)
    # Of each row, which of the parts it is in and where.
    part, place = np.full(links.rows, -1), np.zeros(links.rows, dtype=np.int64)
    for number, rows in enumerate(parts):
        part[rows], place[rows] = number, np.arange(rows.size)
    found = [
        Batch(rows, np.zeros(shape), np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_), [])
        for rows in parts
        for shape in [(rows.size, rows.size)]
    ]
    one, two = pairs_within(chain)
    value, apart = evidence.of(one, two)
    for number, mine in _by_label(part[one], len(parts)):
        a, b = place[one[mine]], place[two[mine]]
        found[number].evidence[a, b] = found[number].evidence[b, a] = value[mine]
        found[number].apart[a, b] = found[number].apart[b, a] = apart[mine]
    for number, mine in _by_label(part[links.one], len(parts)):
        a, b = place[links.one[mine]], place[links.two[mine]]
        found[number].linked[a, b] = found[number].linked[b, a] = True
    for camera in looks:
        # Looks say something only where others of the same chain were seen in this camera as well.
        several = np.bincount(chain[camera.rows] + 1, minlength=int(chain.max(initial=-1)) + 2) > 1
        at = np.flatnonzero(several[chain[camera.rows] + 1] & (chain[camera.rows] >= 0))
        for number, mine in _by_label(part[camera.rows[at]], len(parts)):
            own = at[mine]
            found[number].looks.append(
                CameraLooks(place[camera.rows[own]], camera.total[own], camera.count[own], camera.scale)
            )
    return found


def _packed(chain: Ints, least: int) -> list[Ints]:
    """Put chains together into parts that are worth grouping at once: the rows of each, rising."""
    order = np.argsort(chain, kind="stable")
    order = order[int(np.searchsorted(chain[order], 0)) :]
    found, start = [], 0
    for end in (np.flatnonzero(np.diff(chain[order], append=-1)) + 1).tolist():
        if end - start >= least or end == order.size:
            found.append(np.sort(order[start:end]))
            start = end
    return found


def _by_label(label: Ints, labels: int) -> Iterator[tuple[int, Ints]]:
    """Give those labels from 0 that (P,) things have, and which have them, in order."""
    order = np.argsort(label, kind="stable")
    bounds = np.searchsorted(label[order], np.arange(labels + 1))
    for number, (start, end) in enumerate(pairwise(bounds.tolist())):
        if end > start:
            yield number, order[start:end]
