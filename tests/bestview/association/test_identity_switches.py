"""Two tracks are said to have taken each other's person over: numbers follow the people, in every camera."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import Split, TrackKey
from fakes.bestview.identity_scenes import (
    BLIND,
    CALIBRATED,
    HOWEVER_MANY,
    Stay,
    known,
    numbers,
    play,
    registry,
)

ONE, TWO = TrackKey("south", 1), TrackKey("south", 2)
TAKEN = 100
"""The first frame in which each of two tracks follows the other's person."""


def meeting(apart: float, coats: tuple[int, int] = (3, 3)) -> list[Stay]:
    """Two who pass each other before one camera, whose tracker takes each for the other as they do."""
    ways = [((-3.0, 0.0), (0.03, 0.0)), ((3.0, apart), (-0.03, 0.0))]
    stays = []
    for person, (start, speed) in enumerate(ways):
        before, after = 1 + person, 2 - person
        stays.append(Stay("south", before, 0, TAKEN - 1, start, speed, coats[person]))
        stays.append(Stay("south", after, TAKEN, 999, start, speed, coats[person]))
    return stays


@HOWEVER_MANY
@pytest.mark.parametrize("apart", [0.8, 3.0], ids=["in a crowd", "side by side"])
@pytest.mark.parametrize("told", [115, 170], ids=["soon", "later"])
def test_swapped_tracks_exchange_their_ids(most: int, apart: float, told: int) -> None:
    who, stays = registry(BLIND, maximum_open_tracklets=most), meeting(apart)
    before = known(play(who, stays, told))
    assert before == {ONE: 1, TWO: 2}
    more = known(play(who, stays, told + 5, start=told))
    assert {**before, **more} == before, "nothing tells them apart but somebody's word"
    splits = who.swap_tracks(ONE, TWO, TAKEN, (1, 2))
    assert splits == (Split(1, 2, "south"), Split(2, 1, "south"))
    after = play(who, stays, 500, start=told + 5)
    for update in after:
        assert numbers(update).get(ONE, 2) == 2
        assert numbers(update).get(TWO, 1) == 1
        assert (update.created, update.merged, update.split) == ((), (), ())
    assert known(after)[ONE] == 2


def test_tracklets_of_other_cameras_since_the_swap_are_swapped_too() -> None:
    # The other camera shares no ground, loses both as they pass, and finds them by what the first one says.
    who, stays = registry({**CALIBRATED, "west": CALIBRATED["west"]}), meeting(0.8)
    stays += [
        Stay("west", 5, 0, 90, (-3.0, 0.0), (0.03, 0.0), 3),
        Stay("west", 6, 0, 90, (3.0, 0.8), (-0.03, 0.0), 3),
        Stay("west", 7, 120, 999, (-3.0, 0.0), (0.03, 0.0), 3),
        Stay("west", 8, 120, 999, (3.0, 0.8), (-0.03, 0.0), 3),
    ]
    seen = known(play(who, stays, 180))
    assert len(set(seen.values())) == 2
    who.swap_tracks(ONE, TWO, TAKEN, (1, 2))
    after = known(play(who, stays, 400, start=180))
    assert after["south", 1] == after["west", 8] == seen["west", 6]
    assert after["south", 2] == after["west", 7] == seen["west", 5]


def test_a_swap_that_the_evidence_already_corrected_reports_no_split() -> None:
    who, stays = registry(), meeting(0.8)
    stays += [
        Stay("west", 5, 0, 999, (-3.0, 0.0), (0.03, 0.0), 3),
        Stay("west", 6, 0, 999, (3.0, 0.8), (-0.03, 0.0), 3),
    ]
    play(who, stays, 80)
    seen = known(play(who, stays, 180, start=80))
    assert seen[TWO] == seen["west", 5]
    assert seen[ONE] == seen["west", 6]
    assert who.swap_tracks(ONE, TWO, TAKEN, (1, 2)) == ()
    assert known(play(who, stays, 300, start=180)) == seen


def test_tracks_without_an_id_are_not_swapped() -> None:
    who, stays = registry(BLIND), meeting(0.8)
    assert who.swap_tracks(ONE, TWO, TAKEN, (1, 2)) == ()
    play(who, stays, 115)
    assert who.swap_tracks(ONE, TrackKey("south", 9), TAKEN, (1, 9)) == ()
    assert who.swap_tracks(ONE, ONE, TAKEN, (1, 1)) == ()
    assert who.swap_tracks(ONE, TWO, 0, (0, 0)) == (), "before that frame neither was there"


TRACKS = [TrackKey(camera, local) for camera in ("south", "west") for local in (1, 2, 3)]


@settings(deadline=None, max_examples=10)
@given(
    st.lists(
        st.tuples(st.integers(1, 15), st.sampled_from(TRACKS), st.sampled_from(TRACKS), st.integers(0, 150)),
        max_size=6,
    )
)
def test_after_any_corrections_simultaneous_tracks_of_a_camera_have_different_ids(
    said: list[tuple[int, TrackKey, TrackKey, int]],
) -> None:
    who = registry()
    stays = [
        Stay(camera, local, 0, 999, at)
        for local, at in ((1, (0.0, 0.0)), (2, (2.0, 1.0)), (3, (-2.0, 2.0)))
        for camera in ("south", "west")
    ]
    for step in range(16):
        for update in play(who, stays, 10 * step + 10, start=10 * step):
            for camera in ("south", "west"):
                shown = [number for (of, _), number in numbers(update).items() if of == camera]
                assert len(shown) == len(set(shown))
        for at, one, two, frame in said:
            if at == step and one.camera == two.camera:
                who.swap_tracks(one, two, frame, (1, 2))


def test_nothing_is_stored_for_tracks_that_never_reappear() -> None:
    who = registry(BLIND)
    stays = [replace(it, end=min(it.end, 199)) for it in meeting(3.0)]
    stays.append(Stay("south", 9, 0, 999, (0.0, 5.0)))
    play(who, stays, 200)
    assert who.swap_tracks(ONE, TWO, 190, (1, 2))
    assert set(who._splitter._pending_splits) == {ONE, TWO}, "their next sightings begin new parts"
    play(who, stays, 900, start=200)
    assert not who._splitter._pending_splits
