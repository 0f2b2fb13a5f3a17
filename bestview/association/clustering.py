"""Rows into people: the pair with the most evidence first, as long as evidence speaks for one person."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bestview.association.appearance.likelihood import CameraLooks, LookWeights, distance_of

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
    while (pair := groups.best_pair(join)) is not None:
        groups.merge(*pair)
    return groups.labels()


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
        self._known = weights.known(self._count)
        self._slope = np.repeat([camera.scale.slope(weights) for camera in looks], size)
        self._middle = np.repeat([camera.scale.middle for camera in looks], size)
        self._at = np.full((len(looks), rows), -1)
        """(C, N) of each camera and group: which look, -1: none."""
        self._of: list[dict[int, int]] = [{} for _ in range(rows)]
        """Of each group, the look by camera."""
        start = np.cumsum([0, *size]).tolist()
        for number, (camera, first) in enumerate(zip(looks, start, strict=False)):
            self._at[number, camera.rows] = np.arange(first, first + camera.rows.size)
            for at, row in enumerate(camera.rows.tolist(), first):
                self._of[row][number] = at

    def of_pairs(self, one: Ints, two: Ints) -> Floats:
        """Say what looks say about (P,) pairs of groups: (P,)."""
        told = np.zeros(one.size)
        for camera in self._at:
            a, b = camera[one], camera[two]
            both = np.flatnonzero((a >= 0) & (b >= 0))
            for some in (both[start : start + _SOME] for start in range(0, both.size, _SOME)):
                told[some] += self._evidence(a[some], b[some])
        return told

    def _evidence(self, one: Ints, two: Ints) -> Floats:
        """Evidence of (P,) pairs of looks, each in one camera."""
        distance = distance_of(np.einsum("ij,ij->i", self._root[one], self._root[two]))
        told = self._weights.told(distance, self._slope[one], self._middle[one])
        return told * (self._known[one] * self._known[two])

    def of_group(self, row: int, others: Ints) -> Floats:
        """Say what looks say about a group and (K,) others: (K,)."""
        mine = self._of[row]
        theirs = self._at[np.array(list(mine), dtype=np.int64)[:, None], others]
        camera, other = np.nonzero(theirs >= 0)
        if not other.size:
            return np.zeros(others.size)
        own = np.array(list(mine.values()), dtype=np.int64)[camera]
        return np.asarray(np.bincount(other, self._evidence(theirs[camera, other], own), others.size))

    def merge(self, keep: int, lose: int) -> None:
        """Give one group's looks to another."""
        mine = self._of[keep]
        for number, two in self._of[lose].items():
            one = mine.setdefault(number, two)
            self._at[number, lose] = -1
            self._at[number, keep] = one
            if one != two:
                self._total[one] += self._total[two]
                self._count[one] += self._count[two]
                self._root[one] = np.sqrt(self._total[one] / self._count[one])
                self._known[one] = self._weights.known(self._count[one])
        self._of[lose] = {}


def _padded(table: Floats, columns: int) -> Floats:
    if table.shape[1] == columns:
        return table
    return np.pad(table, ((0, 0), (0, columns - table.shape[1])))


class _Groups:
    """Groups of rows, named by their lowest, with what the best partner of each is worth at hand."""

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
        # Sums keep it: whoever was apart from one of a group is apart from the group.
        self._evidence = np.where(apart, -np.inf, evidence)
        self._past, self._linked = past.copy(), linked.copy()
        np.fill_diagonal(self._linked, val=False)
        self._looks = _Looks(looks, count, weights)
        self._kept = np.arange(count)
        """(N,) the group that each row was made part of, its own where of none."""
        one, two = np.nonzero(np.triu(self._linked, 1))
        value = self._evidence[one, two] + self._looks.of_pairs(one, two)
        value[self._past[one] & self._past[two]] = -np.inf
        self._value = np.full((count, count), -np.inf)
        self._value[one, two] = self._value[two, one] = value
        self._best = self._value.max(axis=1, initial=-np.inf)
        """(N,) the most evidence of each group with another one; -inf: none, or it was merged away."""
        self._at = self._value.argmax(axis=1) if count else np.zeros(0, dtype=np.int64)
        """(N,) with which, the lowest of equals."""
        self._stale = np.zeros(count, dtype=np.bool_)
        """(N,) that one has changed or gone: no other one is worth more than `_best`, but maybe less."""

    def labels(self) -> Ints:
        """Give each row's group: (N,)."""
        label = self._kept.copy()
        # A row is only ever made part of a lower one, whose group is known by then.
        for row in np.flatnonzero(label != np.arange(label.size)).tolist():
            label[row] = label[label[row]]
        return label

    def best_pair(self, least: float) -> tuple[int, int] | None:
        """Give the two groups with the most evidence, the lower first; None: none has `least`."""
        while self._best.size:
            one = int(self._best.argmax())
            if not self._best[one] >= least:
                break
            if not self._stale[one]:
                two = int(self._at[one])
                return min(one, two), max(one, two)
            row = self._value[one]
            self._at[one] = at = row.argmax()
            self._best[one], self._stale[one] = row[at], False
        return None

    def merge(self, keep: int, lose: int) -> None:
        """Make two groups one."""
        self._kept[lose] = keep
        evidence, linked = self._evidence[keep], self._linked[keep]
        evidence += self._evidence[lose]
        self._evidence[:, keep] = evidence
        linked |= self._linked[lose]
        linked[keep] = linked[lose] = False
        # Whoever has no link to either of them had no value with them, and has none now.
        others = linked.nonzero()[0]
        self._linked[others, keep] = True
        self._linked[others, lose] = False
        self._past[keep] &= self._past[lose]
        self._looks.merge(keep, lose)
        value = evidence[others] + self._looks.of_group(keep, others)
        if self._past[keep]:
            value[self._past[others]] = -np.inf
        self._value[others, lose] = -np.inf
        self._value[others, keep] = value
        self._value[keep] = -np.inf
        self._value[keep, others] = value
        self._find_best(keep, lose, others, value)

    def _find_best(self, keep: int, lose: int, others: Ints, value: Floats) -> None:
        """Note what is known now of the best partner of a new group, and of those with a link to it."""
        best, at = self._best[others], self._at[others]
        stale = self._stale[others] | (at == keep) | (at == lose)
        better = value > best
        first = better | ((value == best) & ~stale & (keep < at))
        self._at[others[first]] = keep
        self._best[others[better]] = value[better]
        self._stale[others] = stale & ~better
        self._best[lose] = self._best[keep] = -np.inf
        self._stale[keep] = self._stale[lose] = False
        if others.size:
            place = value.argmax()
            self._best[keep], self._at[keep] = value[place], others[place]
