"""Rows into people: the pair with the most evidence first, as long as evidence speaks for one person."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bestview.likelihood import CameraLooks, LookWeights, distance_of
from bestview.ranges import pairs_within

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SOME = 10_000
"""Pairs whose looks are compared at once: all those of a crowd would be hundreds of megabytes."""


def cluster(
    evidence: Floats,
    apart: NDArray[np.bool_],
    past: NDArray[np.bool_],
    linked: NDArray[np.bool_],
    looks: Sequence[CameraLooks],
    weights: LookWeights,
    join: float,
) -> Ints:
    """Group N rows into people: (N,) the lowest row of each row's group.

    The evidence between two groups is the sum over their pairs of rows, plus that of their looks, which are
    compared as wholes in every camera that has seen both: means of many frames tell more than the sum of
    what single glimpses tell. The two groups with the most evidence become one, until no two reach `join`.
    Groups of which any two rows are `apart` never do, nor those of which no two are `linked`, nor two that
    are `past` only: where nothing is seen nothing changes. So rows between which no chain of links leads have
    no say in each other's groups. Deterministic; ties go to the lowest rows.

    Args:
        evidence: (N, N) symmetric, for (above 0) and against two rows being one person.
        apart: (N, N) symmetric, surely two people.
        past: (N,) not seen lately.
        linked: (N, N) symmetric, something speaks for their being one person.
        looks: how rows look, camera by camera.
        weights: of looks.
        join: the least evidence that joins.
    """
    groups = _Groups(evidence, apart, past, linked, looks, weights)
    while True:
        keep = int(np.argmax(groups.best)) if groups.best.size else 0
        if not groups.best.size or not groups.best[keep] >= join:
            return groups.label
        lose = int(groups.at[keep])
        groups.merge(min(keep, lose), max(keep, lose))


class _Looks:
    """All cameras' looks, L of them, by group.

    Args:
        looks: camera by camera.
        rows: N.
        weights: of looks.
    """

    def __init__(self, looks: Sequence[CameraLooks], rows: int, weights: LookWeights) -> None:
        self._weights = weights
        bins = max((camera.total.shape[1] for camera in looks), default=0)
        size = [camera.rows.size for camera in looks]
        self._total = np.concatenate(
            [np.zeros((0, bins)), *(_padded(camera.total, bins) for camera in looks)]
        )
        self._count = np.concatenate([np.zeros(0), *(camera.count for camera in looks)]).astype(np.float64)
        self._root = np.sqrt(self._total / self._count[:, None])
        """Square roots of the mean histograms, whose products are how alike two are."""
        self._group = np.concatenate([np.zeros(0, dtype=np.int64), *(camera.rows for camera in looks)])
        self._slope = np.repeat([camera.scale.slope(weights) for camera in looks], size)
        self._middle = np.repeat([camera.scale.middle for camera in looks], size)
        start = np.cumsum([0, *size])
        self._camera = [np.arange(a, b) for a, b in pairwise(start.tolist())]
        """(K,) of each camera: which looks are of it."""
        self._of: list[dict[int, int]] = [{} for _ in range(rows)]
        """Of each group, the look by camera."""
        for number, (camera, first) in enumerate(zip(looks, start.tolist(), strict=False)):
            for at, row in enumerate(camera.rows.tolist(), first):
                self._of[row][number] = at

    def add_all(self, to: Floats) -> None:
        """Add to (N, N) what looks say about all rows; before any of them were merged."""
        camera = np.repeat(np.arange(len(self._camera)), [rows.size for rows in self._camera])
        one, two = pairs_within(camera)
        for some in (slice(start, start + _SOME) for start in range(0, one.size, _SOME)):
            told = self._evidence(one[some], two[some])
            a, b = self._group[one[some]], self._group[two[some]]
            np.add.at(to, (a, b), told)
            np.add.at(to, (b, a), told)

    def _evidence(self, one: Ints, two: Ints) -> Floats:
        """Evidence of (P,) pairs of looks, each in one camera."""
        distance = distance_of(np.einsum("ij,ij->i", self._root[one], self._root[two]))
        told = self._weights.told(distance, self._slope[one], self._middle[one])
        # Who was merged away has no frames, and so no evidence.
        return told * self._weights.known(self._count[one], self._count[two])

    def add_evidence(self, row: int, asked: NDArray[np.bool_], to: Floats) -> None:
        """Add to (N,) what looks say about a group and those that are (N,) asked about."""
        mine = self._of[row]
        if not mine:
            return
        others = np.concatenate([self._camera[number] for number in mine])
        own = np.repeat(list(mine.values()), [self._camera[number].size for number in mine])
        some = asked[self._group[others]]
        others, own = others[some], own[some]
        to += np.bincount(self._group[others], self._evidence(others, own), to.size)

    def merge(self, keep: int, lose: int) -> None:
        """Give one group's looks to another."""
        mine = self._of[keep]
        for number, two in self._of[lose].items():
            one = mine.setdefault(number, two)
            if one == two:
                self._group[two] = keep
                continue
            self._total[one] += self._total[two]
            self._count[one] += self._count[two]
            self._count[two] = 0.0
            self._root[one] = np.sqrt(self._total[one] / self._count[one])
        self._of[lose] = {}


def _padded(table: Floats, columns: int) -> Floats:
    if table.shape[1] == columns:
        return table
    return np.pad(table, ((0, 0), (0, columns - table.shape[1])))


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
        linked: NDArray[np.bool_],
        looks: Sequence[CameraLooks],
        weights: LookWeights,
    ) -> None:
        count = len(evidence)
        self._evidence, self._apart, self._past = evidence.copy(), apart.copy(), past.copy()
        self._linked = linked.copy()
        np.fill_diagonal(self._apart, val=True)
        self._looks = _Looks(looks, count, weights)
        self.label = np.arange(count)
        self._value = self._evidence.copy()
        self._looks.add_all(self._value)
        self._value[self._apart | ~self._linked | (self._past[:, None] & self._past)] = -np.inf
        self.best = self._value.max(axis=1, initial=-np.inf)
        self.at = self._value.argmax(axis=1) if count else np.zeros(0, dtype=np.int64)

    def _row(self, row: int) -> Floats:
        value = self._evidence[row].copy()
        possible = self._linked[row] & ~(self._apart[row] | (self._past[row] & self._past))
        self._looks.add_evidence(row, possible, value)
        value[~possible] = -np.inf
        return np.asarray(value)

    def merge(self, keep: int, lose: int) -> None:
        """Make two groups one."""
        self.label[self.label == lose] = keep
        self._evidence[keep] += self._evidence[lose]
        self._evidence[:, keep] = self._evidence[keep]
        self._apart[keep] |= self._apart[lose]
        self._apart[:, keep] = self._apart[keep]
        self._apart[lose] = self._apart[:, lose] = True
        self._linked[keep] |= self._linked[lose]
        self._linked[:, keep] = self._linked[keep]
        self._past[keep] &= self._past[lose]
        self._looks.merge(keep, lose)
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
        groups = anew.nonzero()[0]
        self.at[groups] = at = self._value[groups].argmax(axis=1)
        self.best[groups] = self._value[groups, at]
