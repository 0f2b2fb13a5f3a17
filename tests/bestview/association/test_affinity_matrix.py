"""The affinity matrix equals a reference with dictionaries, while rows come, go and are merged."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import IdentitySettings
from bestview.association.affinity.affinity_matrix import AffinityMatrix, RowKey
from bestview.association.affinity.localized_frames import LocalizedFrames
from bestview.association.co_occurrence import (
    GroundTrajectories,
    pairs_in_one_camera_frame,
    score_ground_proximity,
)
from bestview.association.sightings import TrackObservations
from bestview.association.tracklet import TrackKey, TrackletKey

FRAMES = 4
SETTINGS = IdentitySettings(maximum_ground_evidence=5.0, ground_correlation_s=0.08, comparable_s=4.0).resolve(
    25.0
)
CAP = SETTINGS.maximum_ground_evidence
ROWS = range(10)

PAIR = st.tuples(st.integers(0, 9), st.integers(0, 9)).filter(lambda pair: pair[0] != pair[1])


class ReferenceMatrix:
    """Reference implementation: dictionaries by row keys."""

    def __init__(self) -> None:
        self.rows: list[RowKey] = []
        self.cannot_link: set[frozenset[RowKey]] = set()
        self.proximity_pairs: dict[frozenset[RowKey], tuple[float, int]] = {}
        self.frames_of: dict[RowKey, set[int]] = {}

    def set_rows(self, rows: list[RowKey]) -> None:
        self.rows = rows
        self.cannot_link = {pair for pair in self.cannot_link if pair <= set(rows)}
        self.proximity_pairs = {
            pair: known for pair, known in self.proximity_pairs.items() if pair <= set(rows)
        }
        self.frames_of = {row: self.frames_of.get(row, set()) for row in rows}

    def default_evidence(self, one: RowKey, two: RowKey) -> tuple[float, int]:
        """Return the evidence of a pair without entry: its common frames were at different places."""
        common = len(self.frames_of[one] & self.frames_of[two])
        return max(-2.0 * common / SETTINGS.ground_correlation_frames, -CAP), min(common, 3)

    def ground_evidence(self, one: RowKey, two: RowKey) -> tuple[float, int]:
        return self.proximity_pairs.get(frozenset((one, two)), self.default_evidence(one, two))

    def add_localized_frame(self, row: RowKey, frame: int) -> None:
        self.frames_of[row].add(frame)

    def drop_capped_pairs(self) -> None:
        """Drop entries at the cap whose default evidence is at the cap as well."""
        for pair, (evidence, _) in list(self.proximity_pairs.items()):
            if evidence <= -CAP and self.default_evidence(*pair)[0] <= -CAP:
                del self.proximity_pairs[pair]

    def merge(self, kept: RowKey, lost: RowKey) -> None:
        for other in self.rows:
            one, two = frozenset((kept, other)), frozenset((lost, other))
            if other in {kept, lost}:
                continue
            if two in self.cannot_link:
                self.cannot_link.add(one)
            if one in self.proximity_pairs or two in self.proximity_pairs:
                (a, b), (c, d) = self.ground_evidence(kept, other), self.ground_evidence(lost, other)
                self.proximity_pairs[one] = a + c, max(b, d)
        self.frames_of[kept] |= self.frames_of[lost]
        self.set_rows([row for row in self.rows if row != lost])


def name(row: int) -> RowKey:
    """Return a tracklet key for even rows, a person id for odd ones."""
    return TrackletKey("c0", row, 0) if row % 2 == 0 else row


@settings(deadline=None, max_examples=150)
@given(st.data())
def test_tables_keep_their_entries_while_rows_are_added_and_removed(data: st.DataObject) -> None:
    affinity, reference = AffinityMatrix(SETTINGS), ReferenceMatrix()
    for time in range(data.draw(st.integers(1, 6))):
        rows: list[RowKey] = [
            name(row) for row in data.draw(st.lists(st.integers(0, 9), unique=True, min_size=2))
        ]
        affinity.set_rows(rows)
        reference.set_rows(rows)
        for i, j in data.draw(st.lists(PAIR, max_size=5, unique_by=frozenset)):
            one, two = i % len(rows), j % len(rows)
            pair = frozenset((rows[one], rows[two]))
            if one == two:
                continue
            if data.draw(st.booleans()):
                affinity.add_cannot_links(np.array([one, two]), np.array([two, one]))
                reference.cannot_link.add(pair)
                continue
            score, frames = data.draw(st.integers(-9, 9)), data.draw(st.integers(1, 2))
            affinity.add_ground_evidence(
                np.array([one]), np.array([two]), np.array([float(score)]), np.array([frames])
            )
            evidence, common = reference.ground_evidence(rows[one], rows[two])
            evidence = min(max(evidence + score / SETTINGS.ground_correlation_frames, -CAP), CAP)
            reference.proximity_pairs[pair] = evidence, min(common + frames, 3)
        for row in data.draw(st.lists(st.integers(0, len(rows) - 1), max_size=4, unique=True)):
            frame_set = data.draw(st.sets(st.integers(0, 9), max_size=8))
            localized_frames = np.array(sorted(frame_set), dtype=np.int64) + 10 * time
            affinity.add_localized_frames(np.full(localized_frames.size, row), localized_frames)
            for frame in localized_frames.tolist():
                reference.add_localized_frame(rows[row], frame)
            reference.drop_capped_pairs()
        if data.draw(st.booleans()):
            affinity.merge([(rows[0], rows[1])])
            reference.merge(rows[0], rows[1])
            affinity.set_rows(reference.rows)
        size = len(reference.rows)
        one, two = (side.ravel() for side in np.indices((size, size)))
        different = one != two
        one, two = one[different], two[different]
        pairs = [
            (reference.rows[i], reference.rows[j]) for i, j in zip(one.tolist(), two.tolist(), strict=True)
        ]
        assert affinity.cannot_link(one, two).tolist() == [
            frozenset(pair) in reference.cannot_link for pair in pairs
        ]
        known = [reference.ground_evidence(*pair) for pair in pairs]
        expected = [evidence if common >= 3 else 0.0 for evidence, common in known]
        assert affinity.ground_evidence(one, two).tolist() == expected
        met = {
            frozenset((reference.rows[i], reference.rows[j]))
            for i, j in zip(*affinity.proximity_pairs(), strict=True)
        }
        assert met == set(reference.proximity_pairs)


@settings(deadline=None, max_examples=100)
@given(st.data())
def test_merging_many_rows_at_once_equals_merging_one_by_one(data: st.DataObject) -> None:
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    into = {row: int(rng.integers(4)) for row in range(4, 10) if rng.random() < 0.7}
    at_once, one_by_one = AffinityMatrix(SETTINGS), AffinityMatrix(SETTINGS)
    one, two = np.triu_indices(10, 1)
    met, rivals, alike = (np.flatnonzero(rng.random(one.size) < 0.4) for _ in range(3))
    # Whole numbers, so that the order of sums does not matter; pairs without entry have no common frames.
    score, appearance_score = rng.integers(-4, 5, one.size) * 2.0, rng.integers(1, 3, one.size) * 1.0
    for affinity in (at_once, one_by_one):
        affinity.set_rows([name(row) for row in ROWS])
        affinity.add_ground_evidence(one[met], two[met], score[met], np.full(met.size, 3))
        affinity.add_cannot_links(one[rivals], two[rivals])
        affinity.add_appearance_evidence(one[alike], two[alike], appearance_score[alike])
    at_once.merge([(name(kept), name(lost)) for lost, kept in into.items()])
    for lost, kept in into.items():
        one_by_one.merge([(name(kept), name(lost))])
    remaining = [name(row) for row in ROWS if row not in into]
    one, two = np.triu_indices(len(remaining), 1)
    for affinity in (at_once, one_by_one):
        affinity.set_rows(remaining)
    for table in ("ground_evidence", "cannot_link", "appearance_evidence"):
        assert getattr(at_once, table)(one, two).tolist() == getattr(one_by_one, table)(one, two).tolist()


@settings(deadline=None, max_examples=100)
@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 60)), max_size=12), st.sampled_from([10, 100]))
def test_common_frames_are_counted_as_far_as_they_are_kept(steps: list[tuple[int, int]], frames: int) -> None:
    localized, frames_of, now = LocalizedFrames(frames), [set[int]() for _ in range(4)], 0
    localized.set_rows(np.full(4, -1))
    for row, later in steps:
        now += later
        frames_of[row] |= {now, now + 1}
        frames_of[0] |= {now}
        localized.add(np.array([row, row, 0]), np.array([now, now + 1, now]))
    one, two = np.triu_indices(4, 1)
    common = localized.count_common_frames(one, two, 1000)
    for i, j, count in zip(one.tolist(), two.tolist(), common.tolist(), strict=True):
        both = frames_of[i] & frames_of[j]
        assert len([frame for frame in both if frame > now - frames]) <= count <= len(both)
    for enough in (1, 2, 3):
        assert localized.count_common_frames(one, two, enough).tolist() == np.minimum(common, enough).tolist()


@st.composite
def updates(draw: st.DrawFn) -> tuple[TrackObservations, np.ndarray, np.ndarray]:
    """Draw tracks of standing people in three cameras, some of which are split within the update."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    tracks = draw(st.integers(0, 6))
    camera = np.sort(rng.integers(0, 3, tracks))
    rows = np.where(rng.random((tracks, FRAMES)) < 0.3, -1, np.arange(tracks)[:, None])
    cut = rng.random(tracks) < 0.3
    rows[:, FRAMES // 2 :] += np.where(cut[:, None] & (rows[:, FRAMES // 2 :] >= 0), tracks, 0)
    ground = rng.normal(0, draw(st.sampled_from([1.0, 4.0])), (tracks, FRAMES, 2))
    ground[(rows < 0) | (rng.random(rows.shape) < 0.2)] = np.nan
    half = rng.normal(0, 0.5, (tracks, FRAMES, 2, 2))
    spread = half @ half.swapaxes(-1, -2)
    spread[np.isnan(ground[..., 0])] = np.nan
    keys = tuple(TrackKey(f"c{camera[i]}", i) for i in range(tracks))
    boxes, heights = np.zeros((tracks, FRAMES, 4)), np.ones((tracks, FRAMES))
    return TrackObservations(keys, 0, boxes, ground, spread, heights), rows, camera


@settings(deadline=None, max_examples=100)
@given(updates(), st.floats(0.1, 3.0))
def test_ground_scores_are_summed_over_common_frames(
    update: tuple[TrackObservations, np.ndarray, np.ndarray], gate: float
) -> None:
    observations, rows, camera = update
    count = int(rows.max(initial=-1)) + 1
    met_before = [(i, j) for i in range(count) for j in range(i + 1, count) if (i * j) % 5 == 1]
    expected: dict[frozenset[int], list[float]] = {}
    for one in range(len(rows)):
        for two in range(one):
            for frame in range(FRAMES):
                difference = observations.ground_point[one, frame] - observations.ground_point[two, frame]
                if camera[one] == camera[two] or np.isnan(difference).any():
                    continue
                metric = (
                    observations.ground_covariance[one, frame]
                    + observations.ground_covariance[two, frame]
                    + gate**2 * np.eye(2)
                )
                score = max(1.0 - float(difference @ np.linalg.solve(metric, difference)), -2.0)
                pair = frozenset((int(rows[one, frame]), int(rows[two, frame])))
                expected.setdefault(pair, []).append(score)
    # Pairs that were never close have no entry.
    met_rows = {frozenset(pair) for pair in met_before}
    expected = {pair: scores for pair, scores in expected.items() if max(scores) > -2.0 or pair in met_rows}
    before = np.array(met_before, dtype=np.int64).reshape(-1, 2)
    met = score_ground_proximity(
        GroundTrajectories.of(observations, rows, camera), gate, count, (before[:, 0], before[:, 1]), count
    )
    pairs = [frozenset(pair) for pair in zip(met.first.tolist(), met.second.tolist(), strict=True)]
    assert len(set(pairs)) == len(pairs)
    assert dict(zip(pairs, met.frame_count.tolist(), strict=True)) == {
        pair: len(scores) for pair, scores in expected.items()
    }
    np.testing.assert_allclose(met.score, [sum(expected[pair]) for pair in pairs], atol=1e-9)


@settings(deadline=None, max_examples=100)
@given(updates())
def test_simultaneous_pairs_are_all_pairs_of_a_frame_and_camera(
    update: tuple[TrackObservations, np.ndarray, np.ndarray],
) -> None:
    _, rows, camera = update
    expected = {
        frozenset((int(rows[one, frame]), int(rows[two, frame])))
        for one in range(len(rows))
        for two in range(one)
        for frame in range(FRAMES)
        if camera[one] == camera[two] and min(rows[one, frame], rows[two, frame]) >= 0
    }
    assert {
        frozenset(pair)
        for pair in zip(*(side.tolist() for side in pairs_in_one_camera_frame(rows, camera)), strict=True)
    } == (expected)
