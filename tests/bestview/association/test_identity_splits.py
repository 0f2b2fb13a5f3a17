"""A split by an operator holds against the evidence."""

from __future__ import annotations

from collections.abc import Sequence

from hypothesis import given, settings
from hypothesis import strategies as st

from bestview import Split, TrackKey
from bestview.association.registry.corrections import IdentityUpdate
from fakes.bestview.identity_scenes import (
    OPEN_TRACKLET_LIMITS,
    collect_updates,
    in_two_cameras,
    numbers,
    persons_by_track,
    registry,
)

WEST = TrackKey("west", 1)
TRACKS = [TrackKey(camera, local) for camera in ("south", "west") for local in (1, 2, 3)]


def published_splits(updates: Sequence[IdentityUpdate]) -> list[Split]:
    return [split for update in updates for split in update.split]


@OPEN_TRACKLET_LIMITS
def test_a_split_off_track_gets_a_new_id_and_keeps_it(maximum_open: int) -> None:
    identities, stays = registry(maximum_open_tracklets=maximum_open), in_two_cameras(1, (0, 0))
    assert persons_by_track(collect_updates(identities, stays, 100)) == {("south", 1): 1, ("west", 1): 1}
    assert identities.split_off([WEST], [1]) == 2
    after = collect_updates(identities, stays, 400, start=100)
    for update in after:
        for key, number in update.person_ids.items():
            assert number == (2 if key.camera == "west" else 1)
    assert published_splits(after) == []
    assert all(update.merged == () for update in after)
    assert identities.split_off([WEST], [1]) is None
    assert identities.split_off([WEST], [2]) == 3  # also a settled tracklet, which updates do not contain


@OPEN_TRACKLET_LIMITS
def test_all_tracks_of_a_person_can_be_split_off_together(maximum_open: int) -> None:
    identities, stays = registry(maximum_open_tracklets=maximum_open), in_two_cameras(1, (0, 0))
    collect_updates(identities, stays, 100)
    assert identities.split_off([WEST, TrackKey("south", 1)], [1]) == 2
    after = collect_updates(identities, stays, 300, start=100)
    assert {number for update in after for number in update.person_ids.values()} <= {2}
    assert published_splits(after) == []


def test_a_split_from_another_person_changes_nothing() -> None:
    identities, stays = registry(), in_two_cameras(1, (0, 0))
    assert identities.split_off([WEST], [1]) is None
    collect_updates(identities, stays, 100)
    assert identities.split_off([WEST], [7]) is None
    assert identities.split_off([TrackKey("west", 9)], [1]) is None
    assert set(persons_by_track(collect_updates(identities, stays, 200, start=100)).values()) == {1}


@settings(deadline=None, max_examples=8)
@given(
    st.lists(
        st.tuples(st.integers(1, 11), st.sets(st.sampled_from(TRACKS), min_size=1), st.integers(1, 5)),
        max_size=5,
    )
)
def test_after_any_corrections_simultaneous_tracks_of_a_camera_have_different_ids(
    corrections: list[tuple[int, set[TrackKey], int]],
) -> None:
    identities = registry()
    stays = [
        stay
        for local, at in ((1, (0.0, 0.0)), (2, (2.0, 1.0)), (3, (-2.0, 2.0)))
        for stay in in_two_cameras(local, at)
    ]
    new_ids: set[int] = set()
    for step in range(12):
        for update in collect_updates(identities, stays, 10 * step + 10, start=10 * step):
            for camera in ("south", "west"):
                shown = [number for (of, _), number in numbers(update).items() if of == camera]
                assert len(shown) == len(set(shown))
        for at, tracks, number in corrections:
            if at == step:
                new = identities.split_off(tracks, [number])
                assert new is None or new not in new_ids
                new_ids.add(new or 0)


def test_a_split_off_id_is_never_reused() -> None:
    identities, stays = registry(), in_two_cameras(1, (0, 0))
    collect_updates(identities, stays, 100)
    new = identities.split_off([WEST], [1])
    after = persons_by_track(
        collect_updates(identities, [*stays, *in_two_cameras(5, (4, 1), start=100)], 300, start=100)
    )
    assert after["south", 5] == after["west", 5]
    assert after["south", 5] not in {1, new}
