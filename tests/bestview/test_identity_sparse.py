"""What is kept sparse says what square tables over all tracks would say."""

from __future__ import annotations

from dataclasses import dataclass

import dense_tables as dense
import numpy as np
from dense_identity import DenseRegistry
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import IdentityRegistry, IdentitySettings, LocalTrack, TrackKey
from bestview.evidence import PairEvidence
from bestview.grouping import GroupingProblem, group
from bestview.likeness import GATES_TO_WORST, WORST
from bestview.reach import overlapping, within_reach
from bestview.sightings import FootError, line_up
from bestview.strangers import exact

WINDOW, STRIDE = 15, 5
BOUNDED = settings(deadline=None, max_examples=15)
SEED = st.integers(0, 2**32 - 1)

# Level cameras 10 m off the middle that look at it from three sides, and two plan views; image -> ground.
_LEVEL = np.array([[400.0, 320.0, 0.0], [0.0, 240.0, 1200.0], [0.0, 1.0, 0.0]])
_TURNS = [
    [[1, 0, 0], [0, 1, 10], [0, 0, 1]],
    [[0, -1, 0], [1, 0, 10], [0, 0, 1]],
    [[-1, 0, 0], [0, -1, 10], [0, 0, 1]],
]
GROUNDS = [np.linalg.inv(_LEVEL @ np.array(turn, float)) for turn in _TURNS]
GROUNDS += [np.array([[0.01, 0, x], [0, 0.01, -4.0], [0, 0, 1.0]]) for x in (-4.0, -2.0)]
VIEWS = [np.linalg.inv(ground) for ground in GROUNDS]


@dataclass(frozen=True)
class Crowd:
    """People who walk, stand, hide, and are taken for each other; by chance, from a seed."""

    seed: int
    calibrated: float
    on_grid: bool
    frames: int = 100

    def homographies(self) -> dict[str, NDArray[np.float64] | None]:
        rng = np.random.default_rng(self.seed)
        known = rng.random(len(GROUNDS)) < self.calibrated
        return {f"c{i}": matrix if known[i] else None for i, matrix in enumerate(GROUNDS)}

    def updates(self) -> list[tuple[int, list[LocalTrack]]]:
        rng = np.random.default_rng(self.seed + 1)
        people = int(rng.integers(1, 7))
        # On a grid, standing or at one pace, everything is as far from everything as something else: ties.
        at = rng.integers(-3, 4, (people, 2)) * 1.0 if self.on_grid else rng.uniform(-3, 3, (people, 2))
        pace = rng.choice([0.0, 0.02], (people, 2)) * (1 if self.on_grid else rng.normal(1, 0.3, (people, 2)))
        coats = rng.dirichlet(np.full(12, 0.5), people) * (rng.random((people, 1)) < 0.8)
        trackers = [Tracker(f"c{camera}", people, rng) for camera in range(len(VIEWS))]
        answer = []
        for frame in range(self.frames):
            for tracker, view in zip(trackers, VIEWS, strict=True):
                places = at + pace * frame + rng.normal(0, 0.0 if self.on_grid else 0.1, at.shape)
                tracker.see(frame, view, places, coats)
            if (frame + 1) % STRIDE == 0:
                answer.append((frame, [track for tracker in trackers for track in tracker.window(frame)]))
        return answer


class Tracker:
    """One camera's tracks, with the faults of trackers."""

    def __init__(self, camera: str, people: int, rng: np.random.Generator) -> None:
        self.camera, self.rng = camera, rng
        self.local = list(range(people))
        self.hidden_until = [0] * people
        self.count = people
        self.boxes: dict[int, dict[int, NDArray[np.float64]]] = {}
        self.worn: dict[int, NDArray[np.float64]] = {}

    def see(
        self, frame: int, view: NDArray[np.float64], places: NDArray[np.float64], coats: NDArray[np.float64]
    ) -> None:
        for who, (x, y) in enumerate(places):
            if self.rng.random() < 0.01:
                self.hidden_until[who] = frame + int(self.rng.integers(1, 50))
                if self.rng.random() < 0.6:
                    self.local[who], self.count = self.count, self.count + 1
            if self.rng.random() < 0.004:
                self.local[who], self.local[0] = self.local[0], self.local[who]
            u, v, w = view @ (x, y, 1.0)
            tall = 170.0 if view[2, 1] == 0 else 700.0 / w
            if self.hidden_until[who] <= frame and tall > 0:
                box = np.array([u / w - 0.2 * tall, v / w - tall, u / w + 0.2 * tall, v / w])
                self.boxes.setdefault(self.local[who], {})[frame] = box
                self.worn[self.local[who]] = coats[who]

    def window(self, last: int) -> list[LocalTrack]:
        first = max(0, last - WINDOW + 1)
        answer = []
        for local, mine in self.boxes.items():
            rows = np.array([mine.get(frame, np.full(4, np.nan)) for frame in range(first, last + 1)])
            if not np.isnan(rows).all():
                height = 480.0 if local % 3 else np.inf
                answer.append(LocalTrack(self.camera, local, first, rows, self.worn[local], height))
        return answer


@BOUNDED
@given(SEED, st.sampled_from([0.0, 0.6, 1.0]), st.booleans(), st.sampled_from([None, 1.0, 2.5]))
def test_numbers_and_evidence_are_those_of_square_tables_over_all_tracks(
    seed: int, calibrated: float, on_grid: bool, gate: float | None
) -> None:
    crowd = Crowd(seed, calibrated, on_grid)
    changes = IdentitySettings(gate=gate, hold=float(seed % 4), confirm_updates=1 + seed % 3)
    sparse = IdentityRegistry(changes, crowd.homographies())
    square = DenseRegistry(changes, crowd.homographies())
    for last, tracks in crowd.updates():
        assert sparse.update(tracks, last) == square.update(tracks, last)
        pairs, table = sparse._pairs, square._dense()
        assert pairs.keys == table.keys
        one, two = (rows.ravel() for rows in np.indices(table.evidence.shape))
        np.testing.assert_array_equal(pairs.between(one, two), table.evidence.ravel())
        np.testing.assert_array_equal(pairs.rivals.between(one, two), table.rivals.table.ravel())


def test_strangers_have_no_entries() -> None:
    # Twenty people far apart in two cameras: twenty pairs are near each other, 380 are not.
    ground = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]])
    registry = IdentityRegistry(IdentitySettings(gate=1.0), {"a": ground, "b": ground})
    for last in range(14, 100, STRIDE):
        tracks = [
            LocalTrack(camera, i, last - 14, np.tile([10.0 * i, 0, 10.0 * i + 1, 1.7], (15, 1)), np.zeros(8))
            for camera in ("a", "b")
            for i in range(20)
        ]
        registry.update(tracks, last)
    assert registry._pairs.value.size == 20
    assert registry._pairs.between(np.array([0]), np.array([25])).tolist() == [-IdentitySettings().cap]


@BOUNDED
@given(SEED, st.floats(0.1, 3.0))
def test_whoever_scores_above_the_worst_is_within_reach(seed: int, gate: float) -> None:
    crowd = Crowd(seed, 1.0, on_grid=seed % 2 == 0, frames=15)
    for last, tracks in crowd.updates()[-1:]:
        seen = line_up(tracks, crowd.homographies(), last, FootError(0.05, 0.2))
        one, two = within_reach(seen.ground, seen.spread, gate, GATES_TO_WORST)
        assert (one < two).all()
        near = np.zeros((len(seen.keys),) * 2, dtype=bool)
        near[one, two] = near[two, one] = True
        scores = dense.ground_scores(seen, np.ones(len(seen.keys), bool), gate)
        assert near[scores > WORST].all()
        np.testing.assert_array_equal(seen.distances(one, two, gate), dense.distances(seen, gate)[one, two])


@BOUNDED
@given(SEED)
def test_overlaps_are_those_of_all_pairs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    low = rng.integers(0, 12, (int(rng.integers(0, 30)), 2)) * 1.0
    high = low + rng.integers(0, 5, low.shape)
    one, two = overlapping(low, high)
    brute = [
        (i, j)
        for i in range(len(low))
        for j in range(i + 1, len(low))
        if (low[i] <= high[j]).all() and (low[j] <= high[i]).all()
    ]
    assert sorted(zip(one.tolist(), two.tolist(), strict=True)) == brute


@settings(deadline=None, max_examples=200)
@given(SEED)
def test_groupings_are_those_of_square_tables_ties_and_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tracks = int(rng.integers(1, 25))
    camera = np.sort(rng.integers(0, 5, tracks))
    present = rng.random(tracks) < 0.8
    present[rng.integers(tracks)] = True
    same = camera[:, None] == camera[None, :]
    # Few values: many sums are equal.
    evidence = exact(rng.choice([-2.0, -1.0, 0.0, 0.0, 0.0, 1.0, 1.5, 3.0], (tracks, tracks)))
    heirs = (rng.random((tracks, tracks)) < 0.1) & (present[:, None] != present[None, :])
    evidence = np.triu(np.where(same, np.where(heirs, 1.0, 0.0), evidence), 1)
    rivals = np.triu(same & (rng.random((tracks, tracks)) < 0.5), 1)
    evidence, rivals = evidence + evidence.T, rivals | rivals.T
    person = rng.integers(0, max(1, tracks // 2) + 1, tracks) * 3
    hold, join = rng.choice([0.0, 1.0, 4.0], tracks), float(rng.choice([0.5, 1.0]))
    square = dense.DenseProblem(evidence, rivals, camera, person, present, hold, join)
    sparse = GroupingProblem(_pairs(evidence, rivals, camera), person, present, hold, join)
    np.testing.assert_array_equal(group(sparse), dense.group(square))


def _pairs(
    evidence: NDArray[np.float64], rivals: NDArray[np.bool_], camera: NDArray[np.int64]
) -> PairEvidence:
    pairs = PairEvidence(WORST, 1.0, 100.0, 100)
    pairs.follow([TrackKey(f"c{c}", i) for i, c in enumerate(camera.tolist())], camera)
    one, two = np.nonzero(np.triu(evidence))
    pairs._enter(one, two, evidence[one, two])
    for c in np.unique(camera):
        mine = np.flatnonzero(camera == c)
        pairs.rivals.add(mine, rivals[np.ix_(mine, mine)])
    return pairs


def test_a_person_that_nobody_has_just_now_is_nobodys_new_person() -> None:
    # The highest serial may be that of somebody remembered without a track in play.
    who = IdentityRegistry(IdentitySettings(), {"a": None})
    people = who._people
    for local in (1, 2, 3):
        people.meet(TrackKey("a", local), 0)
    pairs = _pairs(np.zeros((2, 2)), np.zeros((2, 2), bool), np.zeros(2, np.int64))
    pairs.keys = (TrackKey("a", 1), TrackKey("a", 2))
    people.regroup(pairs, np.array([0, 2]), np.array([True, True]))
    assert people.person(TrackKey("a", 2)) is not people.person(TrackKey("a", 3))


def test_pairs_that_could_meet_rule_the_tables_not_the_square_of_the_tracks() -> None:
    def entries(cells: int) -> int:
        """A row of plan views that overlap by half, six people to a cell."""
        grounds = {f"c{c:03d}": np.array([[1.0, 0, 5.0 * c], [0, 1.0, 0], [0, 0, 1.0]]) for c in range(cells)}
        registry = IdentityRegistry(IdentitySettings(gate=1.2), grounds)
        rng = np.random.default_rng(0)
        at = rng.uniform([0, 0], [5.0 * cells + 5.0, 5.0], (6 * cells, 2))
        for last in range(14, 60, STRIDE):
            tracks = []
            for c, camera in enumerate(grounds):
                for i, (x, y) in enumerate(at - [5.0 * c, 0.0]):
                    if 0 <= x < 10:
                        box = np.array([x - 0.3, y - 1.7, x + 0.3, y])
                        tracks.append(LocalTrack(camera, i, last - 14, np.tile(box, (15, 1)), np.zeros(8)))
            registry.update(tracks, last)
        return registry._pairs.value.size

    # Four times the cameras and people: sixteen times would be the square.
    assert entries(32) < 8 * entries(8)
