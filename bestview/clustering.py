"""Rows into people: the pair with the most evidence first, as long as evidence speaks for one person."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.likelihood import CameraLooks, LookWeights, distance_of, look_evidence

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def cluster(
    evidence: Floats,
    apart: NDArray[np.bool_],
    past: NDArray[np.bool_],
    looks: Sequence[CameraLooks],
    weights: LookWeights,
    join: float,
) -> Ints:
    """Group N rows into people: (N,) the lowest row of each row's group.

    The evidence between two groups is the sum over their pairs of rows, plus that of their looks, which are
    compared as wholes in every camera that has seen both: means of many frames tell more than the sum of
    what single glimpses tell. The two groups with the most evidence become one, until no two reach `join`.
    Groups of which any two rows are `apart` never do, nor do two that are `past` only: where nothing is seen
    nothing changes. Deterministic; ties go to the lowest rows.

    Args:
        evidence: (N, N) symmetric, for (above 0) and against two rows being one person.
        apart: (N, N) symmetric, surely two people.
        past: (N,) not seen lately.
        looks: how rows look, camera by camera.
        weights: of looks.
        join: the least evidence that joins.
    """
    groups = _Groups(evidence, apart, past, looks, weights)
    while True:
        keep = int(np.argmax(groups.best)) if groups.best.size else 0
        if not groups.best.size or not groups.best[keep] >= join:
            return groups.label
        lose = int(groups.at[keep])
        groups.merge(min(keep, lose), max(keep, lose))


class _Camera:
    """One camera's looks, by group."""

    def __init__(self, looks: CameraLooks, rows: int, weights: LookWeights) -> None:
        self._total, self._count = looks.total.copy(), looks.count.astype(np.float64)
        self._scale, self._weights = looks.scale, weights
        self._root = np.sqrt(self._total / self._count[:, None])
        """Square roots of the mean histograms, whose products are how alike two are."""
        self._place = np.full(rows, -1)
        """Of each group among these, -1: it was not seen here."""
        self._place[looks.rows] = np.arange(looks.rows.size)
        self._group = looks.rows.copy()

    def every(self) -> tuple[Ints, Floats]:
        """Give the rows, (K,), and what their looks say of all pairs, (K, K)."""
        distance = distance_of(self._root @ self._root.T)
        return self._group, look_evidence(
            distance, self._count[:, None], self._count, self._scale, self._weights
        )

    def add_evidence(self, row: int, to: Floats) -> None:
        """Add to (N,) what the looks here say about a group and all others."""
        at = self._place[row]
        distance = distance_of(self._root @ self._root[at])
        # Who was merged away has no frames, and so no evidence.
        to[self._group] += look_evidence(distance, self._count[at], self._count, self._scale, self._weights)

    def merge(self, keep: int, lose: int) -> bool:
        """Give one group's looks to another; say whether it had none here."""
        one, two = self._place[keep], self._place[lose]
        if one < 0:
            self._place[keep], self._group[two] = two, keep
        else:
            self._total[one] += self._total[two]
            self._count[one] += self._count[two]
            self._count[two] = 0.0
            self._root[one] = np.sqrt(self._total[one] / self._count[one])
        self._place[lose] = -1
        return bool(one < 0)


class _Groups:
    """Groups of rows, named by their lowest, with the best partner of each at hand.

    Attributes:
        label: (N,) each row's group.
        best: (N,) the most evidence of each group with another one; -inf: it was merged away.
        at: (N,) with which.
    """

    def __init__(
        self,
        evidence: Floats,
        apart: NDArray[np.bool_],
        past: NDArray[np.bool_],
        looks: Sequence[CameraLooks],
        weights: LookWeights,
    ) -> None:
        count = len(evidence)
        self._evidence, self._apart, self._past = evidence.copy(), apart.copy(), past.copy()
        np.fill_diagonal(self._apart, val=True)
        self._cameras = [_Camera(camera, count, weights) for camera in looks]
        self._seen_by: list[list[_Camera]] = [[] for _ in range(count)]
        for camera, mine in zip(self._cameras, looks, strict=True):
            for row in mine.rows.tolist():
                self._seen_by[row].append(camera)
        self.label = np.arange(count)
        self._value = self._evidence.copy()
        for camera in self._cameras:
            rows, alike = camera.every()
            self._value[np.ix_(rows, rows)] += alike
        self._value[self._apart | (self._past[:, None] & self._past)] = -np.inf
        self.best = self._value.max(axis=1, initial=-np.inf)
        self.at = self._value.argmax(axis=1) if count else np.zeros(0, dtype=np.int64)

    def _row(self, row: int) -> Floats:
        value = self._evidence[row].copy()
        for camera in self._seen_by[row]:
            camera.add_evidence(row, value)
        value[self._apart[row] | (self._past[row] & self._past)] = -np.inf
        return np.asarray(value)

    def merge(self, keep: int, lose: int) -> None:
        """Make two groups one."""
        self.label[self.label == lose] = keep
        self._evidence[keep] += self._evidence[lose]
        self._evidence[:, keep] = self._evidence[keep]
        self._apart[keep] |= self._apart[lose]
        self._apart[:, keep] = self._apart[keep]
        self._apart[lose] = self._apart[:, lose] = True
        self._past[keep] &= self._past[lose]
        for camera in self._seen_by[lose]:
            if camera.merge(keep, lose):
                self._seen_by[keep].append(camera)
        row = self._row(keep)
        self._value[lose] = self._value[:, lose] = -np.inf
        self._value[keep] = self._value[:, keep] = row
        self._find_best(keep, lose)

    def _find_best(self, keep: int, lose: int) -> None:
        """Look again for the best partner of whoever's may have changed."""
        self.best[lose] = -np.inf
        row = self._value[keep]
        # Lost their partner, or it is worth less to them now.
        anew = ((self.at == keep) | (self.at == lose)) & (self.best > -np.inf)
        anew[keep] = True
        better = ~anew & ((row > self.best) | ((row == self.best) & (keep < self.at)))
        better &= self.best > -np.inf
        self.best[better], self.at[better] = row[better], keep
        for group in np.flatnonzero(anew).tolist():
            self.at[group] = int(np.argmax(self._value[group]))
            self.best[group] = self._value[group, self.at[group]]
