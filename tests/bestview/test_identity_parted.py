"""Somebody's word that whom a camera shows is somebody else holds against the evidence."""

from __future__ import annotations

from collections.abc import Sequence

from test_identity import HOWEVER_MANY, both, known, play, registry

from bestview import Split, TrackKey
from bestview.identity import IdentityUpdate

WEST = TrackKey("west", 1)


def told(updates: Sequence[IdentityUpdate]) -> list[Split]:
    return [it for update in updates for it in update.split]


@HOWEVER_MANY
def test_whom_a_camera_shows_is_somebody_new_and_stays_it(most: int) -> None:
    who, stays = registry(most=most), both(1, (0, 0))
    assert known(play(who, stays, 100)) == {("south", 1): 1, ("west", 1): 1}
    assert who.part([WEST], [1]) == 2
    after = play(who, stays, 700, begin=100)
    for update in after:
        for key, number in update.numbers.items():
            assert number == (2 if key.camera == "west" else 1)
    assert told(after) == []
    assert all(it.merged == () for it in after)
    assert who.part([WEST], [1]) is None
    assert who.part([WEST], [2]) == 3  # also where it was settled, of which updates say nothing


@HOWEVER_MANY
def test_all_that_is_shown_may_be_somebody_new_together(most: int) -> None:
    who, stays = registry(most=most), both(1, (0, 0))
    play(who, stays, 100)
    assert who.part([WEST, TrackKey("south", 1)], [1]) == 2
    after = play(who, stays, 300, begin=100)
    assert {number for update in after for number in update.numbers.values()} <= {2}
    assert told(after) == []


def test_nobody_is_parted_from_whom_they_are_not() -> None:
    who, stays = registry(), both(1, (0, 0))
    assert who.part([WEST], [1]) is None
    play(who, stays, 100)
    assert who.part([WEST], [7]) is None
    assert who.part([TrackKey("west", 9)], [1]) is None
    assert set(known(play(who, stays, 200, begin=100)).values()) == {1}


def test_a_number_that_was_given_so_is_given_to_nobody_else() -> None:
    who, stays = registry(), both(1, (0, 0))
    play(who, stays, 100)
    new = who.part([WEST], [1])
    after = known(play(who, [*stays, *both(5, (4, 1), begin=100)], 300, begin=100))
    assert after["south", 5] == after["west", 5]
    assert after["south", 5] not in {1, new}
