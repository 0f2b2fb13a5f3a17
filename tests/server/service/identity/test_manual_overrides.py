"""Manual merges and splits hold against later automatic decisions."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from bestview import IdentityUpdate, Merge, Split
from fakes.service.scripted_cameras import CAMERAS, LARGE, SMALL, STRIDE, camera_tracks, epoch_of
from fakes.service.scripted_identities import ScriptedRegistry, boxes, identity_update, people
from server.service.identity.manual_overrides import ManualOverrides
from server.service.identity.person_tracker import PersonTracker

numbers = st.integers(1, 6)


@given(st.lists(st.tuples(st.booleans(), numbers, numbers), max_size=12))
def test_a_manual_merge_is_permanent(steps: list[tuple[bool, int, int]]) -> None:
    overrides = ManualOverrides()
    groups: list[set[int]] = [{number} for number in range(1, 7)]
    for is_manual, first, second in steps:
        kept, lost = overrides.current(first), overrides.current(second)
        if kept == lost:
            continue
        if is_manual:
            overrides.merge(kept, lost)
        else:
            update = overrides.apply(identity_update({}, Merge(first, second)))
            lost_numbers = {merge.lost for merge in update.merged}
            assert not lost_numbers & {
                overrides.current(number) for number in range(1, 7) if number not in lost_numbers
            }
            if overrides.current(first) != overrides.current(second):
                continue  # the merge was about a number that is already merged
        together = next(group for group in groups if kept in group) | next(
            group for group in groups if lost in group
        )
        groups = [group for group in groups if not group & together] + [together]
    for group in groups:
        assert len({overrides.current(number) for number in group}) == 1
    for number in range(1, 7):
        assert overrides.current(overrides.current(number)) == overrides.current(number)
        assert number in overrides.automatic_numbers(overrides.current(number))


def scripted_tracker(*updates: IdentityUpdate) -> PersonTracker:
    tracker = people(departed_after_s=0.4)
    tracker._registry = ScriptedRegistry(*updates)  # type: ignore[assignment]
    return tracker


def push_epoch(tracker: PersonTracker, epoch: int) -> None:
    tracker.update(
        epoch_of(epoch, camera_tracks("c0", epoch, {1: SMALL}), camera_tracks("c1", epoch, {1: LARGE}))
    )


TWO = identity_update({("c0", 1): 1, ("c1", 1): 2})


def test_a_manual_merge_holds_against_the_evidence() -> None:
    tracker = scripted_tracker(
        TWO, TWO, replace(TWO, split=(Split(1, 2, "c1"),)), replace(TWO, merged=(Merge(2, 1),))
    )
    push_epoch(tracker, 0)
    tracker.registry.set_name(2, "Ann")
    tracker.merge(1, 2)
    assert tracker.known == [1]
    assert tracker.registry.names == {1: "Ann"}
    assert (tracker.registry.first_seen, tracker.registry.last_seen) == ({1: 0}, {1: STRIDE - 1})
    assert tracker.take_corrections() == (Merge(1, 2),)
    for epoch in (1, 2, 3):
        push_epoch(tracker, epoch)
        assert tracker.known == [1]
        assert tracker.registry.merged == {2: 1}
        assert boxes(tracker, "c0", epoch * STRIDE) == {1: SMALL}
        assert boxes(tracker, "c1", epoch * STRIDE) == {1: LARGE}
    assert tracker.take_corrections() == ()


def test_a_manual_merge_follows_later_automatic_merges() -> None:
    three = identity_update({("c0", 1): 1, ("c1", 1): 2, ("c1", 2): 3})
    tracker = scripted_tracker(three, replace(three, merged=(Merge(3, 1),)), identity_update({("c0", 2): 2}))
    push_epoch(tracker, 0)
    tracker.merge(1, 2)
    push_epoch(tracker, 1)
    tracker.update(epoch_of(2, camera_tracks("c0", 2, {2: SMALL})))
    assert tracker.registry.all_numbers == [3]
    assert tracker.registry.merged == {1: 3, 2: 3}
    assert boxes(tracker, "c0", 2 * STRIDE) == {3: SMALL}


def test_a_manually_merged_person_is_away_when_both_parts_are() -> None:
    tracker = scripted_tracker(
        TWO, replace(TWO, departed=(1,)), replace(TWO, departed=(2,)), replace(TWO, returned=(2,))
    )
    push_epoch(tracker, 0)
    tracker.merge(1, 2)
    for epoch, away in ((1, set()), (2, {1}), (3, set())):
        push_epoch(tracker, epoch)
        assert tracker.registry.departed == away


def test_of_two_names_the_kept_persons_remains() -> None:
    tracker = scripted_tracker(TWO)
    push_epoch(tracker, 0)
    tracker.registry.set_name(1, "Ann")
    tracker.registry.set_name(2, "Bob")
    tracker.merge(1, 2)
    assert tracker.registry.names == {1: "Ann"}
    tracker.registry.set_name(1, "")
    assert tracker.registry.names == {}


def test_a_manual_split_takes_effect_at_once_and_is_permanent() -> None:
    tracker = people()
    for epoch in range(3):
        tracker.update(
            epoch_of(
                epoch,
                camera_tracks("c0", epoch, {1: SMALL, 2: LARGE}),
                camera_tracks("c1", epoch, {1: SMALL}),
            )
        )
    one = tracker.number("c0", 1, 14)
    assert one is not None
    other = tracker.number("c1", 1, 14)
    assert other is not None
    if other != one:
        tracker.merge(one, other)
        tracker.take_corrections()
    assert tracker.split_off(one, ["c1"]) is not None
    [split] = tracker.take_corrections()
    assert isinstance(split, Split)
    new = split.corrected_id
    assert (split.published_id, split.camera) == (one, "c1")
    assert new in tracker.known
    for epoch in range(3, 12):
        assert tracker.number("c1", 1, epoch * STRIDE - 1) == new
        assert tracker.number("c0", 1, epoch * STRIDE - 1) == one
        tracker.update(
            epoch_of(
                epoch,
                camera_tracks("c0", epoch, {1: SMALL, 2: LARGE}),
                camera_tracks("c1", epoch, {1: SMALL}),
            )
        )
    assert tracker.split_off(one, ["c1"]) is None
    assert tracker.split_off(99, CAMERAS) is None
