"""Tables of pairs follow who is in play, and sums over updates are what a plain reading of the rule gives."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview.keys import EpisodeKey, TrackKey
from bestview.meeting import at_once, near
from bestview.pairs import PairTables, Row
from bestview.sightings import Sightings

FRAMES, CAP = 4, 5.0

PAIR = st.tuples(st.integers(0, 9), st.integers(0, 9)).filter(lambda pair: pair[0] != pair[1])


class Dense:
    """The same by names: what is known of each pair in a dictionary."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.apart: set[frozenset[Row]] = set()
        self.near: dict[frozenset[Row], float] = {}
        self.common: dict[frozenset[Row], int] = {}

    def arrange(self, rows: list[Row]) -> None:
        self.rows = rows
        self.apart = {pair for pair in self.apart if pair <= set(rows)}
        for table in (self.near, self.common):
            for pair in [pair for pair in table if not pair <= set(rows)]:
                del table[pair]

    def absorb(self, kept: Row, lost: Row) -> None:
        for other in self.rows:
            one, two = frozenset((kept, other)), frozenset((lost, other))
            if other not in {kept, lost}:
                if two in self.apart:
                    self.apart.add(one)
                self.near[one] = self.near.get(one, 0.0) + self.near.get(two, 0.0)
                self.common[one] = max(self.common.get(one, 0), self.common.get(two, 0))
        self.arrange([row for row in self.rows if row != lost])


def name(row: int) -> Row:
    """Give an episode for the even rows, somebody's past for the others."""
    return EpisodeKey("c0", row, 0) if row % 2 == 0 else row


@settings(deadline=None, max_examples=100)
@given(st.data())
def test_tables_keep_what_is_known_of_pairs_however_rows_come_and_go(data: st.DataObject) -> None:
    tables, dense = PairTables(), Dense()
    for _ in range(data.draw(st.integers(1, 6))):
        rows: list[Row] = [
            name(row) for row in data.draw(st.lists(st.integers(0, 9), unique=True, min_size=2))
        ]
        tables.arrange(rows)
        dense.arrange(rows)
        for i, j in data.draw(st.lists(PAIR, max_size=5, unique_by=frozenset)):
            one, two = i % len(rows), j % len(rows)
            pair = frozenset((rows[one], rows[two]))
            if one == two:
                continue
            if data.draw(st.booleans()):
                tables.add_apart(np.array([one]), np.array([two]))
                dense.apart.add(pair)
                continue
            evidence, frames = data.draw(st.integers(-4, 4)), data.draw(st.integers(1, 2))
            tables.add_near(
                np.array([one]), np.array([two]), np.array([float(evidence)]), np.array([frames]), CAP
            )
            dense.near[pair] = min(max(dense.near.get(pair, 0.0) + evidence, -CAP), CAP)
            dense.common[pair] = dense.common.get(pair, 0) + frames
        if data.draw(st.booleans()):
            tables.absorb(rows[0], rows[1])
            dense.absorb(rows[0], rows[1])
            tables.arrange(dense.rows)
        for i, a in enumerate(dense.rows):
            for j, b in enumerate(dense.rows):
                pair = frozenset((a, b))
                if i != j:
                    assert tables.apart[i, j] == (pair in dense.apart)
                    told = dense.near.get(pair, 0.0) if dense.common.get(pair, 0) >= 3 else 0.0
                    assert tables.near[i, j] == told


@st.composite
def updates(draw: st.DrawFn) -> tuple[Sightings, np.ndarray, np.ndarray]:
    """Draw tracks of three cameras that stand about, some of which are cut within the update."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    tracks = draw(st.integers(0, 6))
    camera = np.sort(rng.integers(0, 3, tracks))
    rows = np.where(rng.random((tracks, FRAMES)) < 0.3, -1, np.arange(tracks)[:, None])
    cut = rng.random(tracks) < 0.3
    rows[:, FRAMES // 2 :] += np.where(cut[:, None] & (rows[:, FRAMES // 2 :] >= 0), tracks, 0)
    ground = rng.normal(0, 1, (tracks, FRAMES, 2))
    ground[(rows < 0) | (rng.random(rows.shape) < 0.2)] = np.nan
    half = rng.normal(0, 0.5, (tracks, FRAMES, 2, 2))
    spread = half @ half.swapaxes(-1, -2)
    spread[np.isnan(ground[..., 0])] = np.nan
    keys = tuple(TrackKey(f"c{camera[i]}", i) for i in range(tracks))
    boxes, heights = np.zeros((tracks, FRAMES, 4)), np.ones((tracks, FRAMES))
    return Sightings(keys, 0, boxes, ground, spread, heights), rows, camera


@settings(deadline=None, max_examples=100)
@given(updates(), st.floats(0.1, 3.0))
def test_nearness_is_the_sum_over_frames_in_which_both_stand_somewhere(
    update: tuple[Sightings, np.ndarray, np.ndarray], gate: float
) -> None:
    seen, rows, camera = update
    expected: dict[frozenset[int], list[float]] = {}
    for one in range(len(rows)):
        for two in range(one):
            for frame in range(FRAMES):
                apart = seen.ground[one, frame] - seen.ground[two, frame]
                if camera[one] == camera[two] or np.isnan(apart).any():
                    continue
                metric = seen.spread[one, frame] + seen.spread[two, frame] + gate**2 * np.eye(2)
                score = max(1.0 - float(apart @ np.linalg.solve(metric, apart)), -2.0)
                pair = frozenset((int(rows[one, frame]), int(rows[two, frame])))
                expected.setdefault(pair, []).append(score)
    met = near(seen, rows, camera, gate, int(rows.max(initial=-1)) + 1)
    pairs = [frozenset(pair) for pair in zip(met.one.tolist(), met.two.tolist(), strict=True)]
    assert len(set(pairs)) == len(pairs)
    assert dict(zip(pairs, met.frames.tolist(), strict=True)) == {it: len(of) for it, of in expected.items()}
    np.testing.assert_allclose(met.score, [sum(expected[pair]) for pair in pairs], atol=1e-9)


@settings(deadline=None, max_examples=100)
@given(updates())
def test_who_is_seen_at_once_in_one_camera_is_every_pair_of_a_frame(
    update: tuple[Sightings, np.ndarray, np.ndarray],
) -> None:
    _, rows, camera = update
    expected = {
        frozenset((int(rows[one, frame]), int(rows[two, frame])))
        for one in range(len(rows))
        for two in range(one)
        for frame in range(FRAMES)
        if camera[one] == camera[two] and min(rows[one, frame], rows[two, frame]) >= 0
    }
    assert {frozenset(it) for it in zip(*(side.tolist() for side in at_once(rows, camera)), strict=True)} == (
        expected
    )
