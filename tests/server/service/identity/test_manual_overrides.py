"""What is said of people by hand holds, whatever is worked out afterwards."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from bestview import IdentityUpdate, Merge, Split
from fakes.service.scripted_cameras import CAMERAS, LARGE, SMALL, STRIDE, camera_tracks, epoch_of
from fakes.service.scripted_identities import ScriptedRegistry, boxes, identity_update, people
from server.service.identity.manual_overrides import ManualOverrides
from server.service.identity.people import PersonTracker

numbers = st.integers(1, 6)


@given(st.lists(st.tuples(st.booleans(), numbers, numbers), max_size=12))
def test_a_manual_merge_is_permanent(steps: list[tuple[bool, int, int]]) -> None:
    it = ManualOverrides()
    one: list[set[int]] = [{number} for number in range(1, 7)]
    for by_hand, first, second in steps:
        kept, lost = it.current(first), it.current(second)
        if kept == lost:
            continue
        if by_hand:
            it.merge(kept, lost)
        else:
            read = it.apply(identity_update({}, Merge(first, second)))
            gone = {merge.lost for merge in read.merged}
            assert not gone & {it.current(number) for number in range(1, 7) if number not in gone}
            if it.current(first) != it.current(second):
                continue  # nobody's word was about the lost one: it is never heard of again
        together = next(group for group in one if kept in group) | next(
            group for group in one if lost in group
        )
        one = [group for group in one if not group & together] + [together]
    for group in one:
        assert len({it.current(number) for number in group}) == 1
    for number in range(1, 7):
        assert it.current(it.current(number)) == it.current(number)
        assert number in it.automatic_numbers(it.current(number))


def dictated(*updates: IdentityUpdate) -> PersonTracker:
    it = people(departed_after=10)
    it._registry = ScriptedRegistry(*updates)  # type: ignore[assignment]
    return it


def seen(it: PersonTracker, epoch: int) -> None:
    it.update(epoch_of(epoch, camera_tracks("c0", epoch, {1: SMALL}), camera_tracks("c1", epoch, {1: LARGE})))


TWO = identity_update({("c0", 1): 1, ("c1", 1): 2})


def test_a_manual_merge_holds_against_the_evidence() -> None:
    it = dictated(TWO, TWO, replace(TWO, split=(Split(1, 2, "c1"),)), replace(TWO, merged=(Merge(2, 1),)))
    seen(it, 0)
    it.registry.set_name(2, "Ann")
    it.merge(1, 2)
    assert it.known == [1]
    assert it.registry.names == {1: "Ann"}
    assert (it.registry.first_seen, it.registry.last_seen) == ({1: 0}, {1: STRIDE - 1})
    assert it.take_corrections() == (Merge(1, 2),)
    for epoch in (1, 2, 3):
        seen(it, epoch)
        assert it.known == [1]
        assert it.registry.merged == {2: 1}
        assert boxes(it, "c0", epoch * STRIDE) == {1: SMALL}
        assert boxes(it, "c1", epoch * STRIDE) == {1: LARGE}
    assert it.take_corrections() == ()


def test_a_manual_merge_follows_later_automatic_merges() -> None:
    three = identity_update({("c0", 1): 1, ("c1", 1): 2, ("c1", 2): 3})
    it = dictated(three, replace(three, merged=(Merge(3, 1),)), identity_update({("c0", 2): 2}))
    seen(it, 0)
    it.merge(1, 2)
    seen(it, 1)
    it.update(epoch_of(2, camera_tracks("c0", 2, {2: SMALL})))
    assert it.registry.all_numbers == [3]
    assert it.registry.merged == {1: 3, 2: 3}
    assert boxes(it, "c0", 2 * STRIDE) == {3: SMALL}


def test_a_manually_merged_person_is_away_when_both_parts_are() -> None:
    it = dictated(TWO, replace(TWO, departed=(1,)), replace(TWO, departed=(2,)), replace(TWO, returned=(2,)))
    seen(it, 0)
    it.merge(1, 2)
    for epoch, away in ((1, set()), (2, {1}), (3, set())):
        seen(it, epoch)
        assert it.registry.departed == away


def test_of_two_names_the_kept_persons_remains() -> None:
    it = dictated(TWO)
    seen(it, 0)
    it.registry.set_name(1, "Ann")
    it.registry.set_name(2, "Bob")
    it.merge(1, 2)
    assert it.registry.names == {1: "Ann"}
    it.registry.set_name(1, "")
    assert it.registry.names == {}


def test_a_manual_split_takes_effect_at_once_and_is_permanent() -> None:
    it = people()
    for epoch in range(3):
        it.update(
            epoch_of(
                epoch,
                camera_tracks("c0", epoch, {1: SMALL, 2: LARGE}),
                camera_tracks("c1", epoch, {1: SMALL}),
            )
        )
    one = it.number("c0", 1, 14)
    assert one is not None
    other = it.number("c1", 1, 14)
    assert other is not None
    if other != one:
        it.merge(one, other)
        it.take_corrections()
    assert it.split_off(one, ["c1"]) is not None
    [split] = it.take_corrections()
    assert isinstance(split, Split)
    new = split.split_off
    assert (split.kept, split.camera) == (one, "c1")
    assert new in it.known
    for epoch in range(3, 12):
        assert it.number("c1", 1, epoch * STRIDE - 1) == new
        assert it.number("c0", 1, epoch * STRIDE - 1) == one
        it.update(
            epoch_of(
                epoch,
                camera_tracks("c0", epoch, {1: SMALL, 2: LARGE}),
                camera_tracks("c1", epoch, {1: SMALL}),
            )
        )
    assert it.split_off(one, ["c1"]) is None
    assert it.split_off(99, CAMERAS) is None
