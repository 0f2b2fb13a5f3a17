"""Rows become people as a plain reading of the rule says, and as the best partition where that is clear."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview.association.appearance.likelihood import (
    AppearanceWeights,
    CameraAppearances,
    DistanceScale,
    appearance_evidence,
    bhattacharyya_distances,
)
from bestview.association.clustering import cluster
from bestview.association.registry.people import assign_ids

WEIGHTS = AppearanceWeights(typical=3.0, maximum=4.0, full_weight_frames=8)
JOIN = 0.5
NEAR = 1e-9


@dataclass(frozen=True)
class Case:
    """What `cluster` is given."""

    evidence: NDArray[np.float64]
    cannot_link: NDArray[np.bool_]
    people: NDArray[np.bool_]
    linked: NDArray[np.bool_]
    appearance: list[CameraAppearances]

    def cluster(self) -> list[int]:
        found = cluster(
            self.evidence, self.cannot_link, self.people, self.linked, self.appearance, WEIGHTS, JOIN
        )
        return [int(label) for label in found]

    def values(self, one: list[int], two: list[int]) -> float:
        """Evidence between two groups, from the beginning."""
        if self.cannot_link[np.ix_(one, two)].any() or self.people[[*one, *two]].all():
            return -np.inf
        if not self.linked[np.ix_(one, two)].any():
            return -np.inf
        return float(self.evidence[np.ix_(one, two)].sum()) + self.look_at(one, two)

    def look_at(self, one: list[int], two: list[int]) -> float:
        """What looks say of two groups."""
        return sum(self._look(it, one, two) for it in self.appearance)

    @staticmethod
    def _look(camera: CameraAppearances, one: list[int], two: list[int]) -> float:
        a, b = (np.isin(camera.rows, group) for group in (one, two))
        if not (a.any() and b.any()):
            return 0.0
        total = [camera.histogram_sum[mine].sum(axis=0)[None] for mine in (a, b)]
        count = np.array([camera.frame_count[mine].sum() for mine in (a, b)])
        distance = bhattacharyya_distances(total[0] / count[0], total[1] / count[1])[0]
        return float(appearance_evidence(distance, count[:1], count[1:], camera.scale, WEIGHTS)[0])


@st.composite
def cases(draw: st.DrawFn, most: int = 9) -> Case:
    count = draw(st.integers(0, most))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    # Whole numbers are often equal; sums of fractions of two are exact, in whatever order.
    unit = draw(st.sampled_from([1, 64]))
    evidence = np.round(unit * rng.normal(0, 2, (count, count))) / unit
    evidence = np.triu(evidence, 1) + np.triu(evidence, 1).T
    apart = np.triu(rng.random((count, count)) < draw(st.sampled_from([0.0, 0.1, 0.4])), 1)
    looks = []
    for _ in range(draw(st.integers(0, 3))):
        rows = np.flatnonzero(rng.random(count) < 0.6)
        if rows.size:
            frames = rng.integers(1, 12, rows.size).astype(float)
            total = rng.dirichlet(np.ones(4), rows.size) * frames[:, None]
            looks.append(CameraAppearances(rows, total, frames, DistanceScale(0.1, 0.3)))
    linked = np.triu(rng.random((count, count)) < draw(st.sampled_from([0.2, 0.6, 1.0])), 1)
    return Case(evidence, apart | apart.T, rng.random(count) < 0.3, linked | linked.T, looks)


def plainly(case: Case) -> list[int]:
    """Join the two groups with the most evidence, all looked at anew every time.

    Cases in which rounding decides, of what looks say, are passed over.
    """
    groups = [[row] for row in range(len(case.evidence))]
    while True:
        pairs = [
            (-case.values(one, two), one[0], two[0], i, j)
            for i, one in enumerate(groups)
            for j, two in enumerate(groups)
            if i < j
        ]
        worth, _, _, i, j = min(pairs, default=(np.inf, 0, 0, 0, 0))
        near = [it for it in pairs if np.isfinite(worth) and abs(it[0] - worth) < NEAR]
        assume(len(near) <= 1 or not any(case.look_at(groups[it[3]], groups[it[4]]) for it in near))
        assume(worth == -JOIN or abs(worth + JOIN) > NEAR)
        if not -worth >= JOIN:
            return [next(group[0] for group in groups if row in group) for row in range(len(case.evidence))]
        groups[i] = sorted(groups[i] + groups[j])
        del groups[j]


@settings(deadline=None, max_examples=300)
@given(cases(12))
def test_clusters_equal_those_of_merging_the_best_pair_until_none_is_left(case: Case) -> None:
    assert case.cluster() == plainly(case)


@settings(deadline=None, max_examples=100)
@given(cases())
def test_cannot_links_are_kept_and_no_mergeable_pair_is_left(case: Case) -> None:
    labels = np.array(case.cluster())
    same = labels[:, None] == labels
    assert not (same & case.cannot_link).any()
    groups = [np.flatnonzero(labels == label).tolist() for label in sorted(set(labels.tolist()))]
    assert all(case.people[group].all() <= (len(group) == 1) for group in groups)
    for i, one in enumerate(groups):
        for two in groups[i + 1 :]:
            assert case.values(one, two) < JOIN + 1e-9


def partitions(rows: list[int]) -> Iterator[list[list[int]]]:
    """All ways to part rows into groups."""
    if not rows:
        yield []
        return
    for rest in partitions(rows[1:]):
        for i in range(len(rest)):
            yield [*rest[:i], [rows[0], *rest[i]], *rest[i + 1 :]]
        yield [[rows[0]], *rest]


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 7), st.integers(0, 2**32))
def test_with_mostly_right_evidence_the_clusters_are_the_best_partition(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    who = rng.integers(0, 3, count)
    same = who[:, None] == who
    evidence = np.where(same, rng.uniform(1, 4, same.shape), rng.uniform(-4, -0.1, same.shape))
    evidence = np.triu(evidence, 1) + np.triu(evidence, 1).T
    nobody = np.zeros(count, dtype=np.bool_)
    all_of_them = np.ones(same.shape, dtype=np.bool_)
    case = Case(evidence, ~all_of_them, nobody, all_of_them, [])
    best = max(
        partitions(list(range(count))),
        key=lambda groups: sum(float(np.triu(evidence[np.ix_(g, g)], 1).sum()) for g in groups),
    )
    assert case.cluster() == [min(group) for row in range(count) for group in best if row in group]


@settings(deadline=None, max_examples=60)
@given(st.lists(st.dictionaries(st.integers(1, 4), st.integers(1, 9), max_size=3), max_size=4))
def test_assigned_ids_keep_the_most_published_frames(told: list[dict[int, int]]) -> None:
    numbers = assign_ids(told)
    given_ = [number for number in numbers if number]
    assert len(given_) == len(set(given_))
    kept = sum(frames.get(number, 0) for frames, number in zip(told, numbers, strict=True))

    def best(at: int, taken: frozenset[int]) -> int:
        if at == len(told):
            return 0
        free = [it for it in told[at] if it not in taken]
        return max([best(at + 1, taken), *(told[at][it] + best(at + 1, taken | {it}) for it in free)])

    assert kept == best(0, frozenset())
