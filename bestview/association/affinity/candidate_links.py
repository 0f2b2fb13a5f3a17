"""Candidate links: pairs of rows with positive evidence, and the independent batches that they form."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from bestview.association.affinity.evidence import PairEvidence
from bestview.association.appearance.likelihood import AppearanceWeights, CameraAppearances
from bestview.association.index_ranges import pairs_of_equal_label

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_MINIMUM_BATCH_ROWS = 64
"""Least rows of a batch: smaller batches cost as much."""


@dataclass(frozen=True, slots=True, eq=False)
class CandidateLinks:
    """P pairs of N rows with positive evidence and no cannot-link, the lower row first, rising.

    Attributes:
        first: (P,) active tracklets.
        second: (P,) tracklets or people.
        rows: N.
    """

    first: Ints
    second: Ints
    rows: int

    @classmethod
    def find(
        cls,
        evidence: PairEvidence,
        appearances: Sequence[CameraAppearances],
        weights: AppearanceWeights,
        active_rows: int,
        rows: int,
    ) -> CandidateLinks:
        """Find the pairs with evidence above 0 of which at least one is among the first `active_rows`.

        Args:
            evidence: without appearance within a camera.
            appearances: one entry a camera; a tracklet is in one only.
            weights: of appearance.
            active_rows: how many rows are active tracklets.
            rows: how many there are.
        """
        first, second = evidence.positive_pairs()
        value = np.zeros(first.size)
        pair_keys = [first * rows + second]
        values = [value]
        place = np.full(rows, -1)
        for camera in appearances:
            place[camera.rows] = np.arange(camera.rows.size)
            alike = np.triu(
                camera.evidence_matrix(weights, int(np.searchsorted(camera.rows, active_rows))), 1
            )
            a, b = place[first], place[second]
            known = (a >= 0) & (b >= 0)
            value[known] = alike[a[known], b[known]]
            a, b = np.nonzero(alike > 0)
            pair_keys.append(camera.rows[a] * rows + camera.rows[b])
            values.append(alike[a, b])
            place[camera.rows] = -1
        pairs, at = np.unique(np.concatenate(pair_keys), return_index=True)
        first, second = pairs // max(rows, 1), pairs % max(rows, 1)
        other_evidence, cannot_link = evidence.of(first, second)
        linked = (np.concatenate(values)[at] + other_evidence > 0) & ~cannot_link
        return cls(first[linked], second[linked], rows)

    def components(self) -> Ints:
        """Return the connected component of each row: (N,) its number, -1: the row has no link."""
        graph = scipy.sparse.coo_array(
            (np.ones(self.first.size), (self.first, self.second)), shape=(self.rows, self.rows)
        )
        _, component = scipy.sparse.csgraph.connected_components(graph, directed=False)
        component = component.astype(np.int64)
        linked = np.zeros(self.rows, dtype=np.bool_)
        linked[self.first] = linked[self.second] = True
        return np.where(linked, component, -1)


@dataclass(frozen=True, slots=True, eq=False)
class ClusteringBatch:
    """Evidence and constraints of N rows that have no link to any other row.

    Attributes:
        rows: (N,) rising.
        evidence: (N, N) symmetric, without appearance; 0 between rows of different components.
        cannot_link: (N, N) symmetric, certainly two people.
        linked: (N, N) symmetric.
        appearance: one entry a camera; their rows are positions in `rows`.
    """

    rows: Ints
    evidence: Floats
    cannot_link: NDArray[np.bool_]
    linked: NDArray[np.bool_]
    appearance: list[CameraAppearances]


def split_into_batches(
    links: CandidateLinks,
    evidence: PairEvidence,
    appearances: Sequence[CameraAppearances],
    minimum_rows: int = _MINIMUM_BATCH_ROWS,
) -> list[ClusteringBatch]:
    """Split the linked rows into batches of whole connected components.

    Args:
        links: between rows.
        evidence: without appearance within a camera.
        appearances: one entry a camera.
        minimum_rows: of a batch, as long as there are so many.
    """
    component = links.components()
    parts = _pack_components(component, minimum_rows)
    # Batch of each row, and its position in the batch.
    part, place = np.full(links.rows, -1), np.zeros(links.rows, dtype=np.int64)
    for number, rows in enumerate(parts):
        part[rows], place[rows] = number, np.arange(rows.size)
    batches = [
        ClusteringBatch(
            rows, np.zeros(shape), np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_), []
        )
        for rows in parts
        for shape in [(rows.size, rows.size)]
    ]
    one, two = pairs_of_equal_label(component)
    value, cannot_link = evidence.of(one, two)
    for number, own_pairs in _indices_by_label(part[one], len(parts)):
        a, b = place[one[own_pairs]], place[two[own_pairs]]
        batches[number].evidence[a, b] = batches[number].evidence[b, a] = value[own_pairs]
        batches[number].cannot_link[a, b] = batches[number].cannot_link[b, a] = cannot_link[own_pairs]
    for number, own_pairs in _indices_by_label(part[links.first], len(parts)):
        a, b = place[links.first[own_pairs]], place[links.second[own_pairs]]
        batches[number].linked[a, b] = batches[number].linked[b, a] = True
    for camera in appearances:
        # Appearance only counts where several rows of a component were seen in this camera.
        several = np.bincount(component[camera.rows] + 1, minlength=int(component.max(initial=-1)) + 2) > 1
        at = np.flatnonzero(several[component[camera.rows] + 1] & (component[camera.rows] >= 0))
        for number, own_pairs in _indices_by_label(part[camera.rows[at]], len(parts)):
            own = at[own_pairs]
            batches[number].appearance.append(
                CameraAppearances(
                    place[camera.rows[own]], camera.histogram_sum[own], camera.frame_count[own], camera.scale
                )
            )
    return batches


def _pack_components(component: Ints, minimum_rows: int) -> list[Ints]:
    """Group components into batches of at least `minimum_rows` rows: the rows of each, rising."""
    order = np.argsort(component, kind="stable")
    order = order[int(np.searchsorted(component[order], 0)) :]
    batches, start = [], 0
    for end in (np.flatnonzero(np.diff(component[order], append=-1)) + 1).tolist():
        if end - start >= minimum_rows or end == order.size:
            batches.append(np.sort(order[start:end]))
            start = end
    return batches


def _indices_by_label(label: Ints, labels: int) -> Iterator[tuple[int, Ints]]:
    """Yield each label from 0 that occurs in (P,) labels, with its indices in order."""
    order = np.argsort(label, kind="stable")
    bounds = np.searchsorted(label[order], np.arange(labels + 1))
    for number, (start, end) in enumerate(pairwise(bounds.tolist())):
        if end > start:
            yield number, order[start:end]
