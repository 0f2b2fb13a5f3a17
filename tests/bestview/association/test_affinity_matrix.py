"""Tables of pairs follow who is in play, and sums over updates are what a plain reading of the rule gives."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import IdentitySettings
from bestview.association.affinity.affinity_matrix import AffinityMatrix, RowKey
from bestview.association.affinity.presence import PresenceBitmap
from bestview.association.co_occurrence import GroundTrajectories, score_ground_proximity, simultaneous_pairs
from bestview.association.sightings import TrackObservations
from bestview.association.tracklet import TrackKey, TrackletKey

FRAMES = 4
SETTINGS = IdentitySettings(maximum_ground_evidence=5.0, ground_correlation_frames=2.0, comparable_frames=100)
CAP = SETTINGS.maximum_ground_evidence
ROWS = range(10)

PAIR = st.tuples(st.integers(0, 9), st.integers(0, 9)).filter(lambda pair: pair[0] != pair[1])


class Plain:
    """The same by names: what is known of each pair in a dictionary."""

    def __init__(self) -> None:
        self.rows: list[RowKey] = []
        self.cannot_link: set[frozenset[RowKey]] = set()
        self.proximity_pairs: dict[frozenset[RowKey], tuple[float, int]] = {}
        self.stood: dict[RowKey, set[int]] = {}

    def set_rows(self, rows: list[RowKey]) -> None:
        self.rows = rows
        self.cannot_link = {pair for pair in self.cannot_link if pair <= set(rows)}
        self.proximity_pairs = {
            pair: known for pair, known in self.proximity_pairs.items() if pair <= set(rows)
        }
        self.stood = {row: self.stood.get(row, set()) for row in rows}

    def elsewhere(self, one: RowKey, two: RowKey) -> tuple[float, int]:
        """What there is to say of two who never met: they were about at once."""
        common = len(self.stood[one] & self.stood[two])
        return max(-2.0 * common / SETTINGS.ground_correlation_frames, -CAP), min(common, 3)

    def ground_evidence(self, one: RowKey, two: RowKey) -> tuple[float, int]:
        return self.proximity_pairs.get(frozenset((one, two)), self.elsewhere(one, two))

    def add_presence(self, row: RowKey, frame: int) -> None:
        self.stood[row].add(frame)

    def let_go(self) -> None:
        """Forget that those met who are elsewhere as much as anybody."""
        for pair, (evidence, _) in list(self.proximity_pairs.items()):
            if evidence <= -CAP and self.elsewhere(*pair)[0] <= -CAP:
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
        self.stood[kept] |= self.stood[lost]
        self.set_rows([row for row in self.rows if row != lost])


def name(row: int) -> RowKey:
    """Return a tracklet for the even rows, a person's past for the others."""
    return TrackletKey("c0", row, 0) if row % 2 == 0 else row


@settings(deadline=None, max_examples=150)
@given(st.data())
def test_tables_keep_their_entries_while_rows_are_added_and_removed(data: st.DataObject) -> None:
    affinity, plain = AffinityMatrix(SETTINGS), Plain()
    for time in range(data.draw(st.integers(1, 6))):
        rows: list[RowKey] = [
            name(row) for row in data.draw(st.lists(st.integers(0, 9), unique=True, min_size=2))
        ]
        affinity.set_rows(rows)
        plain.set_rows(rows)
        for i, j in data.draw(st.lists(PAIR, max_size=5, unique_by=frozenset)):
            one, two = i % len(rows), j % len(rows)
            pair = frozenset((rows[one], rows[two]))
            if one == two:
                continue
            if data.draw(st.booleans()):
                affinity.add_cannot_links(np.array([one, two]), np.array([two, one]))
                plain.cannot_link.add(pair)
                continue
            score, frames = data.draw(st.integers(-9, 9)), data.draw(st.integers(1, 2))
            affinity.add_ground_evidence(
                np.array([one]), np.array([two]), np.array([float(score)]), np.array([frames])
            )
            evidence, common = plain.ground_evidence(rows[one], rows[two])
            evidence = min(max(evidence + score / SETTINGS.ground_correlation_frames, -CAP), CAP)
            plain.proximity_pairs[pair] = evidence, min(common + frames, 3)
        for row in data.draw(st.lists(st.integers(0, len(rows) - 1), max_size=4, unique=True)):
            frames_of = data.draw(st.sets(st.integers(0, 9), max_size=8))
            about = np.array(sorted(frames_of), dtype=np.int64) + 10 * time
            affinity.add_presence(np.full(about.size, row), about)
            for frame in about.tolist():
                plain.add_presence(rows[row], frame)
            plain.let_go()
        if data.draw(st.booleans()):
            affinity.merge([(rows[0], rows[1])])
            plain.merge(rows[0], rows[1])
            affinity.set_rows(plain.rows)
        size = len(plain.rows)
        one, two = (side.ravel() for side in np.indices((size, size)))
        different = one != two
        one, two = one[different], two[different]
        pairs = [(plain.rows[i], plain.rows[j]) for i, j in zip(one.tolist(), two.tolist(), strict=True)]
        assert affinity.cannot_link(one, two).tolist() == [
            frozenset(pair) in plain.cannot_link for pair in pairs
        ]
        known = [plain.ground_evidence(*pair) for pair in pairs]
        expected = [evidence if common >= 3 else 0.0 for evidence, common in known]
        assert affinity.ground_evidence(one, two).tolist() == expected
        met = {
            frozenset((plain.rows[i], plain.rows[j]))
            for i, j in zip(*affinity.proximity_pairs(), strict=True)
        }
        assert met == set(plain.proximity_pairs)


@settings(deadline=None, max_examples=100)
@given(st.data())
def test_merging_many_rows_at_once_equals_merging_one_by_one(data: st.DataObject) -> None:
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    into = {row: int(rng.integers(4)) for row in range(4, 10) if rng.random() < 0.7}
    simultaneous_pairs, in_turn = AffinityMatrix(SETTINGS), AffinityMatrix(SETTINGS)
    one, two = np.triu_indices(10, 1)
    met, apart, alike = (np.flatnonzero(rng.random(one.size) < 0.4) for _ in range(3))
    # Whole numbers, so that the order of sums does not matter; those who never met were not about.
    score, worth = rng.integers(-4, 5, one.size) * 2.0, rng.integers(1, 3, one.size) * 1.0
    for affinity in (simultaneous_pairs, in_turn):
        affinity.set_rows([name(row) for row in ROWS])
        affinity.add_ground_evidence(one[met], two[met], score[met], np.full(met.size, 3))
        affinity.add_cannot_links(one[apart], two[apart])
        affinity.add_appearance_evidence(one[alike], two[alike], worth[alike])
    simultaneous_pairs.merge([(name(kept), name(lost)) for lost, kept in into.items()])
    for lost, kept in into.items():
        in_turn.merge([(name(kept), name(lost))])
    left = [name(row) for row in ROWS if row not in into]
    one, two = np.triu_indices(len(left), 1)
    for affinity in (simultaneous_pairs, in_turn):
        affinity.set_rows(left)
    for table in ("ground_evidence", "cannot_link", "appearance_evidence"):
        assert (
            getattr(simultaneous_pairs, table)(one, two).tolist()
            == getattr(in_turn, table)(one, two).tolist()
        )


@settings(deadline=None, max_examples=100)
@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 60)), max_size=12), st.sampled_from([10, 100]))
def test_presence_counts_recent_common_frames(steps: list[tuple[int, int]], frames: int) -> None:
    presence, stood, now = PresenceBitmap(frames), [set[int]() for _ in range(4)], 0
    presence.set_rows(np.full(4, -1))
    for row, later in steps:
        now += later
        stood[row] |= {now, now + 1}
        stood[0] |= {now}
        presence.add_presence(np.array([row, row, 0]), np.array([now, now + 1, now]))
    one, two = np.triu_indices(4, 1)
    common = presence.common(one, two, 1000)
    for i, j, count in zip(one.tolist(), two.tolist(), common.tolist(), strict=True):
        both = stood[i] & stood[j]
        assert len([frame for frame in both if frame > now - frames]) <= count <= len(both)
    for enough in (1, 2, 3):
        assert presence.common(one, two, enough).tolist() == np.minimum(common, enough).tolist()


@st.composite
def updates(draw: st.DrawFn) -> tuple[TrackObservations, np.ndarray, np.ndarray]:
    """Draw tracks of three cameras that stand about, some of which are cut within the update."""
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
    seen, rows, camera = update
    count = int(rows.max(initial=-1)) + 1
    met_before = [(i, j) for i in range(count) for j in range(i + 1, count) if (i * j) % 5 == 1]
    expected: dict[frozenset[int], list[float]] = {}
    for one in range(len(rows)):
        for two in range(one):
            for frame in range(FRAMES):
                apart = seen.ground_point[one, frame] - seen.ground_point[two, frame]
                if camera[one] == camera[two] or np.isnan(apart).any():
                    continue
                metric = (
                    seen.ground_covariance[one, frame]
                    + seen.ground_covariance[two, frame]
                    + gate**2 * np.eye(2)
                )
                score = max(1.0 - float(apart @ np.linalg.solve(metric, apart)), -2.0)
                pair = frozenset((int(rows[one, frame]), int(rows[two, frame])))
                expected.setdefault(pair, []).append(score)
    # Who is far away all the time, and always was, is not worth a line.
    met_rows = {frozenset(pair) for pair in met_before}
    expected = {it: of for it, of in expected.items() if max(of) > -2.0 or it in met_rows}
    before = np.array(met_before, dtype=np.int64).reshape(-1, 2)
    met = score_ground_proximity(
        GroundTrajectories.of(seen, rows, camera), gate, count, (before[:, 0], before[:, 1]), count
    )
    pairs = [frozenset(pair) for pair in zip(met.first.tolist(), met.second.tolist(), strict=True)]
    assert len(set(pairs)) == len(pairs)
    assert dict(zip(pairs, met.frame_count.tolist(), strict=True)) == {
        it: len(of) for it, of in expected.items()
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
        frozenset(it)
        for it in zip(*(side.tolist() for side in simultaneous_pairs(rows, camera)), strict=True)
    } == (expected)
