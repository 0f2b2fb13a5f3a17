"""After an operator's correction of swapped tracks, ids follow the people in every camera."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import Split, TrackKey
from fakes.bestview.identity_scenes import (
    BLIND,
    CALIBRATED,
    OPEN_TRACKLET_LIMITS,
    StraightTrack,
    collect_updates,
    numbers,
    persons_by_track,
    registry,
)

ONE, TWO = TrackKey("south", 1), TrackKey("south", 2)
SWAP_FRAME = 100
"""The first frame in which each of two tracks follows the other's person."""


def meeting(apart: float, coats: tuple[int, int] = (3, 3)) -> list[StraightTrack]:
    """Return the tracks of two people who pass each other in one camera, whose tracker swaps them."""
    ways = [((-3.0, 0.0), (0.03, 0.0)), ((3.0, apart), (-0.03, 0.0))]
    stays = []
    for person, (start, speed) in enumerate(ways):
        before, after = 1 + person, 2 - person
        stays.append(StraightTrack("south", before, 0, SWAP_FRAME - 1, start, speed, coats[person]))
        stays.append(StraightTrack("south", after, SWAP_FRAME, 999, start, speed, coats[person]))
    return stays


@OPEN_TRACKLET_LIMITS
@pytest.mark.parametrize("apart", [0.8, 3.0], ids=["in a crowd", "side by side"])
@pytest.mark.parametrize("corrected_at", [115, 170], ids=["soon", "later"])
def test_swapped_tracks_exchange_their_ids(maximum_open: int, apart: float, corrected_at: int) -> None:
    identities, stays = registry(BLIND, maximum_open_tracklets=maximum_open), meeting(apart)
    before = persons_by_track(collect_updates(identities, stays, corrected_at))
    assert before == {ONE: 1, TWO: 2}
    more = persons_by_track(collect_updates(identities, stays, corrected_at + 5, start=corrected_at))
    assert {**before, **more} == before, "the evidence does not correct the swap"
    splits = identities.swap_tracks(ONE, TWO, SWAP_FRAME, (1, 2))
    assert splits == (Split(1, 2, "south"), Split(2, 1, "south"))
    after = collect_updates(identities, stays, 500, start=corrected_at + 5)
    for update in after:
        assert numbers(update).get(ONE, 2) == 2
        assert numbers(update).get(TWO, 1) == 1
        assert (update.created, update.merged, update.split) == ((), (), ())
    assert persons_by_track(after)[ONE] == 2


def test_tracklets_of_other_cameras_since_the_swap_are_swapped_too() -> None:
    # The other camera loses both as they pass, and gets their ids from the first one.
    identities, stays = registry({**CALIBRATED, "west": CALIBRATED["west"]}), meeting(0.8)
    stays += [
        StraightTrack("west", 5, 0, 90, (-3.0, 0.0), (0.03, 0.0), 3),
        StraightTrack("west", 6, 0, 90, (3.0, 0.8), (-0.03, 0.0), 3),
        StraightTrack("west", 7, 120, 999, (-3.0, 0.0), (0.03, 0.0), 3),
        StraightTrack("west", 8, 120, 999, (3.0, 0.8), (-0.03, 0.0), 3),
    ]
    seen = persons_by_track(collect_updates(identities, stays, 180))
    assert len(set(seen.values())) == 2
    identities.swap_tracks(ONE, TWO, SWAP_FRAME, (1, 2))
    after = persons_by_track(collect_updates(identities, stays, 400, start=180))
    assert after["south", 1] == after["west", 8] == seen["west", 6]
    assert after["south", 2] == after["west", 7] == seen["west", 5]


def test_a_swap_that_the_evidence_already_corrected_reports_no_split() -> None:
    identities, stays = registry(), meeting(0.8)
    stays += [
        StraightTrack("west", 5, 0, 999, (-3.0, 0.0), (0.03, 0.0), 3),
        StraightTrack("west", 6, 0, 999, (3.0, 0.8), (-0.03, 0.0), 3),
    ]
    collect_updates(identities, stays, 80)
    seen = persons_by_track(collect_updates(identities, stays, 180, start=80))
    assert seen[TWO] == seen["west", 5]
    assert seen[ONE] == seen["west", 6]
    assert identities.swap_tracks(ONE, TWO, SWAP_FRAME, (1, 2)) == ()
    assert persons_by_track(collect_updates(identities, stays, 300, start=180)) == seen


def test_tracks_without_an_id_are_not_swapped() -> None:
    identities, stays = registry(BLIND), meeting(0.8)
    assert identities.swap_tracks(ONE, TWO, SWAP_FRAME, (1, 2)) == ()
    collect_updates(identities, stays, 115)
    assert identities.swap_tracks(ONE, TrackKey("south", 9), SWAP_FRAME, (1, 9)) == ()
    assert identities.swap_tracks(ONE, ONE, SWAP_FRAME, (1, 1)) == ()
    assert identities.swap_tracks(ONE, TWO, 0, (0, 0)) == (), "no track existed before that frame"


TRACKS = [TrackKey(camera, local) for camera in ("south", "west") for local in (1, 2, 3)]


@settings(deadline=None, max_examples=10)
@given(
    st.lists(
        st.tuples(st.integers(1, 15), st.sampled_from(TRACKS), st.sampled_from(TRACKS), st.integers(0, 150)),
        max_size=6,
    )
)
def test_after_any_corrections_simultaneous_tracks_of_a_camera_have_different_ids(
    corrections: list[tuple[int, TrackKey, TrackKey, int]],
) -> None:
    identities = registry()
    stays = [
        StraightTrack(camera, local, 0, 999, at)
        for local, at in ((1, (0.0, 0.0)), (2, (2.0, 1.0)), (3, (-2.0, 2.0)))
        for camera in ("south", "west")
    ]
    for step in range(16):
        for update in collect_updates(identities, stays, 10 * step + 10, start=10 * step):
            for camera in ("south", "west"):
                shown = [number for (of, _), number in numbers(update).items() if of == camera]
                assert len(shown) == len(set(shown))
        for at, one, two, frame in corrections:
            if at == step and one.camera == two.camera:
                identities.swap_tracks(one, two, frame, (1, 2))


def test_nothing_is_stored_for_tracks_that_never_reappear() -> None:
    identities = registry(BLIND)
    stays = [replace(stay, end=min(stay.end, 199)) for stay in meeting(3.0)]
    stays.append(StraightTrack("south", 9, 0, 999, (0.0, 5.0)))
    collect_updates(identities, stays, 200)
    assert identities.swap_tracks(ONE, TWO, 190, (1, 2))
    assert set(identities._splitter._pending_splits) == {ONE, TWO}, (
        "their next observations start new tracklets"
    )
    collect_updates(identities, stays, 900, start=200)
    assert not identities._splitter._pending_splits
