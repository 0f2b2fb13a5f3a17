"""Agglomerative clustering of tracklets and known people into persons, with cannot-link constraints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.association.appearance.likelihood import (
    AppearanceWeights,
    CameraAppearances,
    bhattacharyya_distance,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_COMPARISON_CHUNK = 10_000
"""Pairs whose appearance is compared at once: all pairs of a crowd would need hundreds of megabytes."""


def cluster(
    evidence: Floats,
    cannot_link: NDArray[np.bool_],
    unseen: NDArray[np.bool_],
    linked: NDArray[np.bool_],
    appearances: Sequence[CameraAppearances],
    weights: AppearanceWeights,
    threshold: float,
) -> Ints:
    """Cluster N rows (tracklets and known people) into persons.

    The affinity of two clusters is the sum of the evidence between their rows, plus the evidence of their
    appearance, which is compared as the mean histograms of whole clusters in every camera that has seen both:
    the mean of many frames is more reliable than the sum of single comparisons. The two clusters with the
    highest affinity are merged until no two reach `threshold`. Two clusters are not merged if any of their
    rows have a cannot-link, if no link connects them, or if both are `unseen`: without observations nothing
    changes. Rows that no chain of links connects therefore do not influence each other. Deterministic; ties
    go to the lowest rows.

    Args:
        evidence: (N, N) symmetric log-likelihood ratios, above 0 for and below 0 against one person.
        cannot_link: (N, N) symmetric, pairs that are certainly two people.
        unseen: (N,) not seen recently.
        linked: (N, N) symmetric, pairs with positive evidence.
        appearances: of rows, one entry a camera.
        weights: of appearance.
        threshold: the least affinity that merges.

    Returns:
        (N,) the lowest row of each row's cluster.
    """
    clusters = _Clusters(evidence, cannot_link, unseen, linked, appearances, weights)
    while (pair := clusters.best_pair(threshold)) is not None:
        clusters.merge(*pair)
    return clusters.labels()


class _ClusterAppearances:
    """Appearance of all clusters in all cameras, L mean histograms.

    Args:
        appearances: one entry a camera.
        rows: N.
        weights: of appearance.
    """

    def __init__(
        self, appearances: Sequence[CameraAppearances], rows: int, weights: AppearanceWeights
    ) -> None:
        self._weights = weights
        bins = max((camera.histogram_sum.shape[1] for camera in appearances), default=0)
        size = [camera.rows.size for camera in appearances]
        self._total = np.concatenate(
            [np.zeros((0, bins)), *(_pad_bins(camera.histogram_sum, bins) for camera in appearances)]
        )
        self._count = np.concatenate([np.zeros(0), *(camera.frame_count for camera in appearances)]).astype(
            np.float64
        )
        self._root = np.sqrt(self._total / self._count[:, None])
        """Square roots of the mean histograms: their products are Bhattacharyya coefficients."""
        self._known = weights.confidence(self._count)
        self._slope = np.repeat([camera.scale.slope(weights) for camera in appearances], size)
        self._middle = np.repeat([camera.scale.neutral_distance for camera in appearances], size)
        self._histogram_index = np.full((len(appearances), rows), -1)
        """(C, N) index of the histogram of each camera and cluster; -1: none."""
        self._indices: list[dict[int, int]] = [{} for _ in range(rows)]
        """By cluster, the index of its histogram by camera."""
        start = np.cumsum([0, *size]).tolist()
        for number, (camera, first) in enumerate(zip(appearances, start, strict=False)):
            self._histogram_index[number, camera.rows] = np.arange(first, first + camera.rows.size)
            for at, row in enumerate(camera.rows.tolist(), first):
                self._indices[row][number] = at

    def of_pairs(self, first: Ints, second: Ints) -> Floats:
        """Return the appearance evidence of (P,) pairs of clusters: (P,)."""
        evidence = np.zeros(first.size)
        for camera in self._histogram_index:
            a, b = camera[first], camera[second]
            both = np.flatnonzero((a >= 0) & (b >= 0))
            for chunk in (
                both[start : start + _COMPARISON_CHUNK] for start in range(0, both.size, _COMPARISON_CHUNK)
            ):
                evidence[chunk] += self._evidence(a[chunk], b[chunk])
        return evidence

    def _evidence(self, first: Ints, second: Ints) -> Floats:
        """Compute the evidence of (P,) pairs of histograms, each of one camera."""
        distance = bhattacharyya_distance(np.einsum("ij,ij->i", self._root[first], self._root[second]))
        evidence = self._weights.evidence(distance, self._slope[first], self._middle[first])
        return evidence * (self._known[first] * self._known[second])

    def of_cluster(self, row: int, others: Ints) -> Floats:
        """Return the appearance evidence between one cluster and (K,) others: (K,)."""
        own_histograms = self._indices[row]
        other_histograms = self._histogram_index[
            np.array(list(own_histograms), dtype=np.int64)[:, None], others
        ]
        camera, other = np.nonzero(other_histograms >= 0)
        if not other.size:
            return np.zeros(others.size)
        own = np.array(list(own_histograms.values()), dtype=np.int64)[camera]
        return np.asarray(
            np.bincount(other, self._evidence(other_histograms[camera, other], own), others.size)
        )

    def merge(self, keep: int, lose: int) -> None:
        """Add one cluster's histograms to another's."""
        histograms = self._indices[keep]
        for number, lost in self._indices[lose].items():
            kept = histograms.setdefault(number, lost)
            self._histogram_index[number, lose] = -1
            self._histogram_index[number, keep] = kept
            if kept != lost:
                self._total[kept] += self._total[lost]
                self._count[kept] += self._count[lost]
                self._root[kept] = np.sqrt(self._total[kept] / self._count[kept])
                self._known[kept] = self._weights.confidence(self._count[kept])
        self._indices[lose] = {}


def _pad_bins(table: Floats, columns: int) -> Floats:
    if table.shape[1] == columns:
        return table
    return np.pad(table, ((0, 0), (0, columns - table.shape[1])))


class _Clusters:
    """Clusters of rows, named by their lowest row, with a cached best partner of each."""

    def __init__(
        self,
        evidence: Floats,
        cannot_link: NDArray[np.bool_],
        unseen: NDArray[np.bool_],
        linked: NDArray[np.bool_],
        appearances: Sequence[CameraAppearances],
        weights: AppearanceWeights,
    ) -> None:
        count = len(evidence)
        # Minus infinity survives sums: a cannot-link of one row holds for its cluster.
        self._evidence = np.where(cannot_link, -np.inf, evidence)
        self._unseen, self._linked = unseen.copy(), linked.copy()
        np.fill_diagonal(self._linked, val=False)
        self._appearances = _ClusterAppearances(appearances, count, weights)
        self._merged_into = np.arange(count)
        """(N,) the cluster that each row was merged into; itself: none."""
        one, two = np.nonzero(np.triu(self._linked, 1))
        value = self._evidence[one, two] + self._appearances.of_pairs(one, two)
        value[self._unseen[one] & self._unseen[two]] = -np.inf
        self._value = np.full((count, count), -np.inf)
        self._value[one, two] = self._value[two, one] = value
        self._best = self._value.max(axis=1, initial=-np.inf)
        """(N,) the highest affinity of each cluster with another one; -inf: none, or it was merged away."""
        self._partner = self._value.argmax(axis=1) if count else np.zeros(0, dtype=np.int64)
        """(N,) the partner with that affinity, the lowest of equals."""
        self._stale = np.zeros(count, dtype=np.bool_)
        """(N,) the partner has changed or was merged away: `_best` is an upper bound only."""

    def labels(self) -> Ints:
        """Return each row's cluster: (N,)."""
        label = self._merged_into.copy()
        # A row is merged only into a lower one, whose cluster is known by then.
        for row in np.flatnonzero(label != np.arange(label.size)).tolist():
            label[row] = label[label[row]]
        return label

    def best_pair(self, threshold: float) -> tuple[int, int] | None:
        """Return the two clusters with the highest affinity, the lower first; None: below `threshold`."""
        while self._best.size:
            one = int(self._best.argmax())
            if not self._best[one] >= threshold:
                break
            if not self._stale[one]:
                two = int(self._partner[one])
                return min(one, two), max(one, two)
            row = self._value[one]
            self._partner[one] = at = row.argmax()
            self._best[one], self._stale[one] = row[at], False
        return None

    def merge(self, keep: int, lose: int) -> None:
        """Merge cluster `lose` into cluster `keep`."""
        self._merged_into[lose] = keep
        evidence, linked = self._evidence[keep], self._linked[keep]
        evidence += self._evidence[lose]
        self._evidence[:, keep] = evidence
        linked |= self._linked[lose]
        linked[keep] = linked[lose] = False
        # Clusters without a link to either had no affinity with them, and have none now.
        others = linked.nonzero()[0]
        self._linked[others, keep] = True
        self._linked[others, lose] = False
        self._unseen[keep] &= self._unseen[lose]
        self._appearances.merge(keep, lose)
        value = evidence[others] + self._appearances.of_cluster(keep, others)
        if self._unseen[keep]:
            value[self._unseen[others]] = -np.inf
        self._value[others, lose] = -np.inf
        self._value[others, keep] = value
        self._value[keep] = -np.inf
        self._value[keep, others] = value
        self._find_best(keep, lose, others, value)

    def _find_best(self, keep: int, lose: int, others: Ints, value: Floats) -> None:
        """Update the cached best partners of a merged cluster and of the clusters linked to it."""
        best, at = self._best[others], self._partner[others]
        stale = self._stale[others] | (at == keep) | (at == lose)
        better = value > best
        first = better | ((value == best) & ~stale & (keep < at))
        self._partner[others[first]] = keep
        self._best[others[better]] = value[better]
        self._stale[others] = stale & ~better
        self._best[lose] = self._best[keep] = -np.inf
        self._stale[keep] = self._stale[lose] = False
        if others.size:
            place = value.argmax()
            self._best[keep], self._partner[keep] = value[place], others[place]
