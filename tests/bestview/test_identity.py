"""One person is one number in every camera, and stays it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import IdentityRegistry, IdentitySettings, IdentityUpdate, LocalTrack, Merge, Split, TrackKey

WINDOW, STRIDE = 15, 5
FOCAL, EYE = 400.0, 3.0


def camera_from(side: str) -> NDArray[np.float64]:
    """Give the ground -> image homography of a level camera 10 m off the middle, looking at it; metres."""
    level = np.array([[FOCAL, 320.0, 0.0], [0.0, 240.0, FOCAL * EYE], [0.0, 1.0, 0.0]])
    turned = {
        "south": [[1, 0, 0], [0, 1, 10], [0, 0, 1]],
        "west": [[0, -1, 0], [1, 0, 10], [0, 0, 1]],
        "north": [[-1, 0, 0], [0, -1, 10], [0, 0, 1]],
    }
    return np.asarray(level @ np.array(turned[side], float))


VIEWS = {side: camera_from(side) for side in ("north", "south", "west")}
CALIBRATED: Mapping[str, NDArray[np.float64] | None] = {
    side: np.asarray(np.linalg.inv(view), float) for side, view in VIEWS.items()
}
BLIND: Mapping[str, NDArray[np.float64] | None] = dict.fromkeys(VIEWS)


@dataclass(frozen=True)
class Stay:
    """A person under one local number in one camera, for some frames, along a line on the ground."""

    camera: str
    local: int
    begin: int
    end: int
    start: tuple[float, float]
    speed: tuple[float, float] = (0.0, 0.0)
    coat: int = 0

    def box(self, frame: int) -> NDArray[np.float64]:
        x, y = (p + v * frame for p, v in zip(self.start, self.speed, strict=True))
        u, v, w = VIEWS[self.camera] @ (x, y, 1.0)
        tall = FOCAL * 1.75 / w
        return np.array([u / w - 0.2 * tall, v / w - tall, u / w + 0.2 * tall, v / w])

    def track(self, first: int, last: int) -> LocalTrack:
        boxes = np.full((last - first + 1, 4), np.nan)
        for frame in range(max(first, self.begin), min(last, self.end) + 1):
            boxes[frame - first] = self.box(frame)
        return LocalTrack(self.camera, self.local, first, boxes, coat(self.coat))


def coat(which: int) -> NDArray[np.float64]:
    """Give a histogram with a hump of its own; 0: unknown."""
    hump = np.exp(-(((np.arange(64) - 8.0 * which) / 4.0) ** 2))
    return hump / hump.sum() if which else np.zeros(64)


def play(
    registry: IdentityRegistry, stays: Sequence[Stay], frames: int, begin: int = 0
) -> list[IdentityUpdate]:
    return list(updates(registry, stays, frames, begin))


def updates(
    registry: IdentityRegistry, stays: Sequence[Stay], frames: int, begin: int = 0
) -> Iterator[IdentityUpdate]:
    for last in range(begin + STRIDE - 1, frames, STRIDE):
        first = max(0, last - WINDOW + 1)
        tracks: dict[tuple[str, int], LocalTrack] = {}
        for stay in stays:
            if stay.begin <= last and stay.end >= first:
                track = stay.track(first, last)
                before = tracks.get((stay.camera, stay.local), track)
                boxes = np.where(np.isnan(track.boxes), before.boxes, track.boxes)
                tracks[stay.camera, stay.local] = replace(track, boxes=boxes)
        yield registry.update(list(tracks.values()), last)


def registry(
    homographies: Mapping[str, NDArray[np.float64] | None] = CALIBRATED, **changes: float
) -> IdentityRegistry:
    return IdentityRegistry(replace(IdentitySettings(), **changes), homographies)  # type: ignore[arg-type]


def both(local: int, start: tuple[float, float], begin: int = 0, end: int = 999) -> list[Stay]:
    return [Stay("south", local, begin, end, start), Stay("west", local, begin, end, start)]


def numbers(update: IdentityUpdate) -> dict[tuple[str, int], int]:
    return {(key.camera, key.local): number for key, number in update.numbers.items()}


def test_a_person_has_one_number_in_every_camera() -> None:
    stays = [
        Stay("south", 4, 0, 999, (0, 0)),
        Stay("west", 9, 0, 999, (0, 0)),
        Stay("south", 5, 0, 999, (3, 1)),
        Stay("west", 8, 0, 999, (3, 1)),
    ]
    last = numbers(play(registry(), stays, 60)[-1])
    assert last["south", 4] == last["west", 9]
    assert last["south", 5] == last["west", 8]
    assert sorted(last.values()) == [1, 1, 2, 2]


def test_numbers_are_shown_only_when_confirmed_and_born_once() -> None:
    seen = play(registry(confirm_updates=4), both(1, (0, 0)), 60)
    assert [update.born for update in seen] == [(), (), (), (1,)] + [()] * 8
    assert [len(update.numbers) for update in seen[:4]] == [0, 0, 0, 2]


def test_two_people_seen_side_by_side_in_one_camera_are_two_however_close() -> None:
    stays = [*both(1, (0, 0)), *both(2, (0.3, 0.3))]
    last = numbers(play(registry(), stays, 100)[-1])
    assert last["south", 1] != last["south", 2]
    assert last["west", 1] != last["west", 2]
    assert last["south", 1] == last["west", 1]


def test_a_restarted_camera_finds_everybody_again() -> None:
    people = [(-2.0, -2.0), (2.0, -1.0), (0.0, 3.0)]
    stays = [Stay("south", 1 + i, 0, 999, at) for i, at in enumerate(people)]
    stays += [Stay("west", 1 + i, 0, 99, at) for i, at in enumerate(people)]
    stays += [Stay("west", 101 + i, 150, 999, at) for i, at in enumerate(people)]
    seen = play(registry(), stays, 200)
    again = numbers(seen[(150 // STRIDE) + 2])  # three updates after it came back
    assert [again["west", 101 + i] for i in range(3)] == [again["south", 1 + i] for i in range(3)]
    assert max(max(update.numbers.values(), default=0) for update in seen) == 3


def test_who_is_lost_and_found_at_the_same_place_keeps_the_number() -> None:
    stays = [Stay("south", 1, 0, 100, (0, 0)), Stay("south", 2, 110, 999, (0, 0))]
    for homographies in (CALIBRATED, BLIND):
        seen = play(registry(homographies), stays, 200)
        assert numbers(seen[-1]) == {("south", 2): 1}
        assert all(update.born in {(), (1,)} for update in seen)


def test_who_turns_up_elsewhere_at_once_is_somebody_else() -> None:
    stays = [Stay("south", 1, 0, 100, (-4, 0)), Stay("south", 2, 104, 999, (4, 0))]
    assert numbers(play(registry(), stays, 200)[-1]) == {("south", 2): 2}


def test_who_returns_in_the_same_coat_gets_the_number_back() -> None:
    stays = [Stay("south", coat, 0, 150, (coat - 3.0, 0), coat=coat) for coat in (1, 3, 5)]
    stays += [Stay("south", 10, 400, 999, (4, 2), coat=3), Stay("south", 11, 450, 999, (-4, 2), coat=6)]
    seen = play(registry(), stays, 600)
    assert [update.gone for update in seen if update.gone] == [(1, 2, 3)]
    assert [update.returned for update in seen if update.returned] == [(2,)]
    assert numbers(seen[-1]) == {("south", 10): 2, ("south", 11): 4}


def test_in_a_crowd_dressed_alike_nobody_gets_anothers_number_back() -> None:
    stays = [Stay("south", local, 0, 150, (local - 3.0, 0), coat=3) for local in (1, 2, 3)]
    stays += [Stay("south", 10, 400, 999, (4, 2), coat=3)]
    assert numbers(play(registry(), stays, 600)[-1]) == {("south", 10): 4}


def test_without_calibration_coats_that_differ_join_and_coats_that_do_not_do_not() -> None:
    def dressed(coats: Sequence[int]) -> dict[tuple[str, int], int]:
        stays = [
            Stay(camera, 1 + i, 0, 999, (2.0 * i - 3, 0), coat=worn)
            for camera in ("south", "west")
            for i, worn in enumerate(coats)
        ]
        return numbers(play(registry(BLIND), stays, 600)[-1])

    differing = dressed([1, 3, 5, 7])
    assert all(differing["south", i] == differing["west", i] for i in (1, 2, 3, 4))
    alike = dressed([3, 3, 3, 3])
    assert len(dict.fromkeys(alike.values())) == 8


def test_evidence_corrects_a_number_and_says_so() -> None:
    # Too far apart to be one at first, they turn out to walk as one.
    apart = [Stay("south", 1, 0, 99, (0, 0)), Stay("west", 1, 0, 99, (0, 6))]
    joined = [Stay("south", 1, 100, 999, (0, 0)), Stay("west", 1, 100, 999, (0, 0))]
    seen = play(registry(), [*apart, *joined], 300)
    assert numbers(seen[15]) == {("south", 1): 1, ("west", 1): 2}
    assert [update.merged for update in seen if update.merged] == [(Merge(1, 2),)]
    assert numbers(seen[-1]) == {("south", 1): 1, ("west", 1): 1}


def test_a_track_that_changes_its_person_changes_its_number_and_not_before_evidence_has_mounted() -> None:
    at = {1: (-2.0, 0.0), 2: (2.0, 0.0)}
    stays = [Stay(camera, i, 0, 299, at[i]) for camera in VIEWS for i in (1, 2)]
    # From frame 200 the tracker of one camera takes each for the other.
    stays = [replace(s, end=199) if s.camera == "west" else s for s in stays]
    stays += [Stay("west", i, 200, 299, at[3 - i]) for i in (1, 2)]
    updated = play(registry(), stays, 300)
    seen = [numbers(update) for update in updated]
    assert seen[200 // STRIDE] == seen[190 // STRIDE]
    before, after = seen[190 // STRIDE], seen[-1]
    assert after["west", 1] == before["west", 2] == after["south", 2] == before["south", 2]
    assert after["west", 2] == before["west", 1] == after["south", 1] == before["south", 1]
    told = [split for update in updated for split in update.split]
    assert told == [Split(1, 2, "west"), Split(2, 1, "west")]


def test_who_shared_a_number_with_somebody_else_gets_one_of_their_own_and_it_is_said() -> None:
    # One camera sees two who walk as one and then part; the others see the one who stays.
    together = [Stay(camera, 1, 0, 150, (0, 0)) for camera in VIEWS]
    apart = [Stay(camera, 1, 151, 999, (4, 3) if camera == "west" else (0, 0)) for camera in VIEWS]
    updated = play(registry(), [*together, *apart], 400)
    assert numbers(updated[150 // STRIDE - 1]) == {("south", 1): 1, ("west", 1): 1, ("north", 1): 1}
    assert [split for update in updated for split in update.split] == [Split(1, 2, "west")]
    assert numbers(updated[-1]) == {("south", 1): 1, ("west", 1): 2, ("north", 1): 1}


def test_feet_cut_off_by_the_picture_do_not_stand_where_the_cut_is() -> None:
    near = Stay("south", 1, 0, 999, (0, -7))  # 3 m before the camera: the feet are far below the picture
    cut = 480.0
    other = Stay("west", 1, 0, 999, (0, -5))  # stands where a foot at the edge of the south picture would

    def seen(height: float) -> IdentityUpdate:
        who = registry()
        for last in range(14, 200, STRIDE):
            south = near.track(last - 14, last)
            boxes = south.boxes.copy()
            boxes[:, 3] = np.minimum(boxes[:, 3], cut)
            south = replace(south, boxes=boxes, picture_height=height)
            update = who.update([south, other.track(last - 14, last)], last)
        return update

    assert numbers(seen(np.inf)) == {("south", 1): 1, ("west", 1): 1}
    assert numbers(seen(cut)) == {("south", 1): 1, ("west", 1): 2}


@settings(deadline=None, max_examples=10)
@given(st.data())
def test_the_same_updates_in_any_order_of_tracks_give_the_same_numbers(data: st.DataObject) -> None:
    spot = st.tuples(st.integers(-4, 4), st.integers(-4, 4))
    stays = []
    for camera in VIEWS:
        for local in range(1, data.draw(st.integers(1, 3)) + 1):
            begin = data.draw(st.integers(0, 60))
            end = begin + data.draw(st.integers(5, 80))
            stays.append(Stay(camera, local, begin, end, data.draw(spot), coat=data.draw(st.integers(0, 4))))
    shuffled = data.draw(st.permutations(stays))
    one, two = registry(), registry()
    for first, second in zip(updates(one, stays, 140), updates(two, shuffled, 140), strict=True):
        assert first == second
        for camera in VIEWS:
            visible = [n for (c, _), n in numbers(first).items() if c == camera]
            assert all(number >= 1 for number in visible)


@settings(deadline=None, max_examples=10)
@given(st.data())
def test_two_tracks_seen_at_once_in_one_camera_never_share_a_number(data: st.DataObject) -> None:
    spot = st.tuples(st.integers(-3, 3), st.integers(-3, 3))
    stays = [
        Stay(camera, local, 0, 200, data.draw(spot), coat=data.draw(st.integers(0, 3)))
        for camera in VIEWS
        for local in range(1, data.draw(st.integers(1, 4)) + 1)
    ]
    for update in updates(registry(), stays, 100):
        for camera in VIEWS:
            here = [number for key, number in update.numbers.items() if key.camera == camera]
            assert len(here) == len(dict.fromkeys(here))


def test_memory_does_not_grow_with_the_length_of_the_recording() -> None:
    who = registry(forget_after=200, remember=5, track_memory=100)
    stays = [Stay("south", i, 30 * i, 30 * i + 25, (4.0 * (-1) ** i, i % 5 - 2)) for i in range(100)]
    sizes = []
    for _ in updates(who, stays, 3000):
        people = who._people
        sizes.append((len(people), len(people._serial_of), len(who._pairs.keys), len(who._heirs._last)))
    assert max(max(size) for size in sizes) <= 20
    assert sizes[-1][0] <= 10


def test_what_makes_no_sense_is_refused_in_one_line() -> None:
    track = Stay("south", 1, 0, 99, (0, 0)).track(0, 14)

    def refused(match: str, *tracks: LocalTrack, last: int = 14) -> None:
        with pytest.raises(ValueError, match=match) as refusal:
            registry().update(tracks, last)
        assert "\n" not in str(refusal.value)

    refused("camera is not known", replace(track, camera="cellar"))
    refused("shape", replace(track, boxes=np.zeros((15, 3))))
    refused("histogram", replace(track, histogram=np.zeros((2, 2))))
    refused("beyond frame 10", track, last=10)
    refused("given twice", track, track)
    with pytest.raises(ValueError, match="of camera south is not invertible"):
        IdentityRegistry(IdentitySettings(), {"south": np.ones((3, 3))})
    who = registry()
    who.update([track], 14)
    with pytest.raises(ValueError, match="comes after"):
        who.update([track], 14)
    with pytest.raises(ValueError, match="memory"):
        IdentitySettings(memory=1.5)
    with pytest.raises(ValueError, match="gate"):
        IdentitySettings(gate=0.0)


def test_no_tracks_are_no_people() -> None:
    update = registry().update([], 4)
    assert update == IdentityUpdate({}, (), (), (), (), ())
    assert TrackKey("a", 2) < TrackKey("b", 1)
