"""Tracks are associated in a thread: the event loop goes on, and what changes identities waits for it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from bestview import IdentityUpdate
from fakes.service.held_association import hold, release_when_waited_for
from fakes.service.scripted_cameras import LARGE, SMALL, STRIDE, camera_tracks, epoch_of
from fakes.service.scripted_identities import boxes, people
from fakes.timeouts import PATIENCE
from server.service.identity.person_tracker import PersonTracker
from server.service.ingest.epoch_aligner import Epoch

EPOCHS = 4


def epoch(number: int) -> Epoch:
    return epoch_of(
        number,
        camera_tracks("c0", number, {1: SMALL, 2: LARGE}),
        camera_tracks(
            "c1", number, {1: SMALL if number else None, 5: LARGE if number == EPOCHS - 1 else None}
        ),
    )


def tracked_people() -> PersonTracker:
    tracker = people()
    for number in range(EPOCHS - 1):
        tracker.update(epoch(number))
    tracker.merge(1, 3)
    return tracker


def state(tracker: PersonTracker) -> tuple[object, ...]:
    return (
        tracker.newest,
        tracker.known,
        tracker.registry.merged,
        tracker.overrides.merged,
        [boxes(tracker, camera, EPOCHS * STRIDE - 1) for camera in ("c0", "c1")],
        tracker.tracks_of(tracker.known, 0),
        tracker.identity.next_id,
        [person.person_id for person in tracker.identity.people],
        tracker.take_corrections(),
    )


async def test_the_event_loop_runs_while_tracks_are_associated() -> None:
    tracker, sequential = tracked_people(), tracked_people()
    released = hold(tracker)
    associating = asyncio.create_task(tracker.associate(epoch(EPOCHS - 1)))
    for _ in range(10):
        await asyncio.sleep(0)
    assert not associating.done()
    assert tracker.known == sequential.known, "whoever reads numbers does not wait"
    released.set()
    async with asyncio.timeout(PATIENCE):
        await associating
    windows = [window.message for window in tracker.update(epoch(EPOCHS - 1))]
    assert windows == [window.message for window in sequential.update(epoch(EPOCHS - 1))]
    assert state(tracker) == state(sequential)


CHANGES: dict[str, Callable[[PersonTracker], object]] = {
    "merge": lambda tracker: tracker.merge(1, 2),
    "split": lambda tracker: tracker.split_off(1, ["c1"]),
    "forget": lambda tracker: tracker.forget([2]),
    "renumber": lambda tracker: tracker.renumber({1: 7}),
    "reserve": lambda tracker: tracker.identity.reserve_below(40),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
async def test_a_change_waits_for_the_association(change: Callable[[PersonTracker], object]) -> None:
    tracker, sequential = tracked_people(), tracked_people()
    sequential.update(epoch(EPOCHS - 1))
    released = hold(tracker)
    associating = asyncio.create_task(tracker.associate(epoch(EPOCHS - 1)))
    await asyncio.sleep(0)
    release_when_waited_for(tracker, released)
    assert change(tracker) == change(sequential)
    async with asyncio.timeout(PATIENCE):
        await associating
    tracker.update(epoch(EPOCHS - 1))
    unchanged = tracked_people()
    unchanged.update(epoch(EPOCHS - 1))
    assert state(tracker) == (changed := state(sequential))
    assert changed != state(unchanged)


async def test_an_association_that_nobody_waits_for_any_more_counts() -> None:
    tracker, sequential = tracked_people(), tracked_people()
    sequential.update(epoch(EPOCHS - 1))
    released = hold(tracker)
    associating = asyncio.create_task(tracker.associate(epoch(EPOCHS - 1)))
    await asyncio.sleep(0)
    associating.cancel()
    await asyncio.wait([associating])
    release_when_waited_for(tracker, released)
    tracker.update(epoch(EPOCHS - 1))
    assert state(tracker) == state(sequential)


async def test_an_error_is_raised_where_the_result_is_used() -> None:
    tracker = tracked_people()

    def fail(*_: Any) -> IdentityUpdate:
        raise ArithmeticError

    tracker._registry.update = fail  # type: ignore[method-assign]
    async with asyncio.timeout(PATIENCE):
        await tracker.associate(epoch(EPOCHS - 1))
    with pytest.raises(ArithmeticError):
        tracker.update(epoch(EPOCHS - 1))
