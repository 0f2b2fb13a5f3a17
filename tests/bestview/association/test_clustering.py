"""Clusters equal those of a simple reference, and the best partition where the evidence is clear."""

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
from bestview.association.registry.people import assign_published_ids

WEIGHTS = AppearanceWeights(typical=3.0, maximum=4.0, full_weight_frames=8)
THRESHOLD = 0.5
ROUNDING = 1e-9


@dataclass(frozen=True)
class Case:
    """Inputs of `cluster`."""

    evidence: NDArray[np.float64]
    cannot_link: NDArray[np.bool_]
    unseen: NDArray[np.bool_]
    linked: NDArray[np.bool_]
    appearance: list[CameraAppearances]

    def cluster(self) -> list[int]:
        found = cluster(
            self.evidence, self.cannot_link, self.unseen, self.linked, self.appearance, WEIGHTS, THRESHOLD
        )
        return [int(label) for label in found]

    def values(self, one: list[int], two: list[int]) -> float:
        """Compute the evidence between two groups from scratch."""
        if self.cannot_link[np.ix_(one, two)].any() or self.unseen[[*one, *two]].all():
            return -np.inf
        if not self.linked[np.ix_(one, two)].any():
            return -np.inf
        return float(self.evidence[np.ix_(one, two)].sum()) + self.appearance_evidence_between(one, two)

    def appearance_evidence_between(self, one: list[int], two: list[int]) -> float:
        """Compute the appearance evidence between two groups."""
        return sum(self._camera_evidence(camera, one, two) for camera in self.appearance)

    @staticmethod
    def _camera_evidence(camera: CameraAppearances, one: list[int], two: list[int]) -> float:
        a, b = (np.isin(camera.rows, group) for group in (one, two))
        if not (a.any() and b.any()):
            return 0.0
        total = [camera.histogram_sum[rows].sum(axis=0)[None] for rows in (a, b)]
        count = np.array([camera.frame_count[rows].sum() for rows in (a, b)])
        distance = bhattacharyya_distances(total[0] / count[0], total[1] / count[1])[0]
        return float(appearance_evidence(distance, count[:1], count[1:], camera.scale, WEIGHTS)[0])


@st.composite
def cases(draw: st.DrawFn, most: int = 9) -> Case:
    count = draw(st.integers(0, most))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    # Whole numbers are often equal; sums of fractions of two are exact, in any order.
    unit = draw(st.sampled_from([1, 64]))
    evidence = np.round(unit * rng.normal(0, 2, (count, count))) / unit
    evidence = np.triu(evidence, 1) + np.triu(evidence, 1).T
    apart = np.triu(rng.random((count, count)) < draw(st.sampled_from([0.0, 0.1, 0.4])), 1)
    appearances = []
    for _ in range(draw(st.integers(0, 3))):
        rows = np.flatnonzero(rng.random(count) < 0.6)
        if rows.size:
            frames = rng.integers(1, 12, rows.size).astype(float)
            total = rng.dirichlet(np.ones(4), rows.size) * frames[:, None]
            appearances.append(CameraAppearances(rows, total, frames, DistanceScale(0.1, 0.3)))
    linked = np.triu(rng.random((count, count)) < draw(st.sampled_from([0.2, 0.6, 1.0])), 1)
    return Case(evidence, apart | apart.T, rng.random(count) < 0.3, linked | linked.T, appearances)


def reference_clusters(case: Case) -> list[int]:
    """Merge the two groups with the most evidence, all recomputed every time.

    Cases in which the rounding of appearance evidence decides are skipped.
    """
    groups = [[row] for row in range(len(case.evidence))]
    while True:
        pairs = [
            (-case.values(one, two), one[0], two[0], i, j)
            for i, one in enumerate(groups)
            for j, two in enumerate(groups)
            if i < j
        ]
        cost, _, _, i, j = min(pairs, default=(np.inf, 0, 0, 0, 0))
        near = [pair for pair in pairs if np.isfinite(cost) and abs(pair[0] - cost) < ROUNDING]
        assume(
            len(near) <= 1
            or not any(case.appearance_evidence_between(groups[pair[3]], groups[pair[4]]) for pair in near)
        )
        assume(cost == -THRESHOLD or abs(cost + THRESHOLD) > ROUNDING)
        if not -cost >= THRESHOLD:
            return [next(group[0] for group in groups if row in group) for row in range(len(case.evidence))]
        groups[i] = sorted(groups[i] + groups[j])
        del groups[j]


@settings(deadline=None, max_examples=300)
@given(cases(12))
def test_clusters_equal_those_of_merging_the_best_pair_until_none_is_left(case: Case) -> None:
    assert case.cluster() == reference_clusters(case)


@settings(deadline=None, max_examples=100)
@given(cases())
def test_cannot_links_are_kept_and_no_mergeable_pair_is_left(case: Case) -> None:
    labels = np.array(case.cluster())
    same = labels[:, None] == labels
    assert not (same & case.cannot_link).any()
    groups = [np.flatnonzero(labels == label).tolist() for label in sorted(set(labels.tolist()))]
    assert all(case.unseen[group].all() <= (len(group) == 1) for group in groups)
    for i, one in enumerate(groups):
        for two in groups[i + 1 :]:
            assert case.values(one, two) < THRESHOLD + 1e-9


def partitions(rows: list[int]) -> Iterator[list[list[int]]]:
    """Yield all partitions of rows into groups."""
    if not rows:
        yield []
        return
    for smaller in partitions(rows[1:]):
        for i in range(len(smaller)):
            yield [*smaller[:i], [rows[0], *smaller[i]], *smaller[i + 1 :]]
        yield [[rows[0]], *smaller]


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 7), st.integers(0, 2**32))
def test_with_mostly_right_evidence_the_clusters_are_the_best_partition(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    person = rng.integers(0, 3, count)
    same = person[:, None] == person
    evidence = np.where(same, rng.uniform(1, 4, same.shape), rng.uniform(-4, -0.1, same.shape))
    evidence = np.triu(evidence, 1) + np.triu(evidence, 1).T
    none_unseen = np.zeros(count, dtype=np.bool_)
    all_pairs = np.ones(same.shape, dtype=np.bool_)
    case = Case(evidence, ~all_pairs, none_unseen, all_pairs, [])
    best = max(
        partitions(list(range(count))),
        key=lambda groups: sum(float(np.triu(evidence[np.ix_(g, g)], 1).sum()) for g in groups),
    )
    assert case.cluster() == [min(group) for row in range(count) for group in best if row in group]


@settings(deadline=None, max_examples=60)
@given(st.lists(st.dictionaries(st.integers(1, 4), st.integers(1, 9), max_size=3), max_size=4))
def test_assigned_ids_keep_the_most_published_frames(published: list[dict[int, int]]) -> None:
    numbers = assign_published_ids(published)
    assigned = [number for number in numbers if number]
    assert len(assigned) == len(set(assigned))
    kept = sum(frames.get(number, 0) for frames, number in zip(published, numbers, strict=True))

    def best(at: int, used: frozenset[int]) -> int:
        if at == len(published):
            return 0
        free = [person_id for person_id in published[at] if person_id not in used]
        return max(
            [
                best(at + 1, used),
                *(published[at][person_id] + best(at + 1, used | {person_id}) for person_id in free),
            ]
        )

    assert kept == best(0, frozenset())
