"""Somebody's word that whom a camera shows is somebody else holds against the evidence."""

from __future__ import annotations

from collections.abc import Sequence

from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import Split, TrackKey
from bestview.association.registry.identity_registry import IdentityUpdate
from fakes.bestview.identity_scenes import HOWEVER_MANY, both, known, numbers, play, registry

WEST = TrackKey("west", 1)
TRACKS = [TrackKey(camera, local) for camera in ("south", "west") for local in (1, 2, 3)]


def told(updates: Sequence[IdentityUpdate]) -> list[Split]:
    return [it for update in updates for it in update.split]


@HOWEVER_MANY
def test_a_split_off_track_gets_a_new_id_and_keeps_it(most: int) -> None:
    who, stays = registry(maximum_open_tracklets=most), both(1, (0, 0))
    assert known(play(who, stays, 100)) == {("south", 1): 1, ("west", 1): 1}
    assert who.split_off([WEST], [1]) == 2
    after = play(who, stays, 400, start=100)
    for update in after:
        for key, number in update.person_ids.items():
            assert number == (2 if key.camera == "west" else 1)
    assert told(after) == []
    assert all(it.merged == () for it in after)
    assert who.split_off([WEST], [1]) is None
    assert who.split_off([WEST], [2]) == 3  # also where it was settled, of which updates say nothing


@HOWEVER_MANY
def test_all_tracks_of_a_person_can_be_split_off_together(most: int) -> None:
    who, stays = registry(maximum_open_tracklets=most), both(1, (0, 0))
    play(who, stays, 100)
    assert who.split_off([WEST, TrackKey("south", 1)], [1]) == 2
    after = play(who, stays, 300, start=100)
    assert {number for update in after for number in update.person_ids.values()} <= {2}
    assert told(after) == []


def test_a_split_from_another_person_changes_nothing() -> None:
    who, stays = registry(), both(1, (0, 0))
    assert who.split_off([WEST], [1]) is None
    play(who, stays, 100)
    assert who.split_off([WEST], [7]) is None
    assert who.split_off([TrackKey("west", 9)], [1]) is None
    assert set(known(play(who, stays, 200, start=100)).values()) == {1}


@settings(deadline=None, max_examples=8)
@given(
    st.lists(
        st.tuples(st.integers(1, 11), st.sets(st.sampled_from(TRACKS), min_size=1), st.integers(1, 5)),
        max_size=5,
    )
)
def test_after_any_corrections_simultaneous_tracks_of_a_camera_have_different_ids(
    said: list[tuple[int, set[TrackKey], int]],
) -> None:
    who = registry()
    stays = [
        it for local, at in ((1, (0.0, 0.0)), (2, (2.0, 1.0)), (3, (-2.0, 2.0))) for it in both(local, at)
    ]
    given_so: set[int] = set()
    for step in range(12):
        for update in play(who, stays, 10 * step + 10, start=10 * step):
            for camera in ("south", "west"):
                shown = [number for (of, _), number in numbers(update).items() if of == camera]
                assert len(shown) == len(set(shown))
        for at, tracks, number in said:
            if at == step:
                new = who.split_off(tracks, [number])
                assert new is None or new not in given_so
                given_so.add(new or 0)


def test_a_split_off_id_is_never_reused() -> None:
    who, stays = registry(), both(1, (0, 0))
    play(who, stays, 100)
    new = who.split_off([WEST], [1])
    after = known(play(who, [*stays, *both(5, (4, 1), start=100)], 300, start=100))
    assert after["south", 5] == after["west", 5]
    assert after["south", 5] not in {1, new}
