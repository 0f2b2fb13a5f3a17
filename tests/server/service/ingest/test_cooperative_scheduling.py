"""Decisions yield to other tasks, and are the same."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Sequence

import pytest

from fakes.service.decisions import EPOCHS, collect_decisions, service_with_backlog
from fakes.service.scripted_cameras import (
    STRIDE,
)
from server.messaging.inbox import Inbox
from server.service.ingest.backlog import BacklogMonitor
from server.service.ingest.epoch_aligner import Epoch
from server.service.view_selection.decider import GopDecision


async def test_other_tasks_run_between_two_epochs() -> None:
    service, turns = service_with_backlog(), list[int]()
    deciding = asyncio.create_task(service.decide_or_skip())
    while not deciding.done():
        turns.append(service.aligner._next or 0)
        await asyncio.sleep(0)
    assert list(dict.fromkeys(turns)) == list(range(EPOCHS + 1))
    service.close()


async def test_waiting_messages_are_handled_before_the_next_epoch() -> None:
    service, handled, waited = service_with_backlog(), list[int](), list[int]()
    inbox = Inbox(handled.append, turn_s=0.0)
    service.bus.inboxes.append(inbox)
    finish = service._finish_epoch

    def noting(epoch: Epoch, decisions: Sequence[GopDecision]) -> None:
        waited.append(inbox.waiting)
        finish(epoch, decisions)
        for number in range(5):
            inbox.put(number)

    service._finish_epoch = noting  # type: ignore[method-assign]
    await service.decide_or_skip()
    assert waited == [0] * EPOCHS
    assert len(handled) == 5 * EPOCHS
    service.close()


async def test_a_flood_does_not_keep_the_service_from_deciding() -> None:
    service = service_with_backlog()
    inbox: Inbox[int] = Inbox(lambda left: inbox.put(left - 1) if left else None, turn_s=0.0)
    service.bus.inboxes.append(inbox)
    inbox.put(100_000)
    await service.decide_or_skip()
    assert inbox.waiting
    assert service.aligner._next == EPOCHS
    service.close()


async def test_epochs_whose_frames_are_no_longer_buffered_are_skipped(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Decisions are half as fast as the pulses."""
    service, now = service_with_backlog(), itertools.count(0.0, 1.5)
    service._backlog_monitor = BacklogMonitor(2 * STRIDE, lambda: next(now))
    decided, finish = list[int](), service._finish_epoch

    def slow(epoch: Epoch, decisions: Sequence[GopDecision]) -> None:
        decided.append(epoch.number)
        service.pulses.newest += 2 * STRIDE
        finish(epoch, decisions)

    service._finish_epoch = slow  # type: ignore[method-assign]
    await service.decide_or_skip()
    assert decided[-1] == EPOCHS - 1, "it continues with the newest"
    assert service.skipped_epochs == EPOCHS - len(decided) > 0
    assert "do not catch up" in caplog.text
    assert service.aligner.waiting_windows == 0
    service.close()


async def test_a_cancelled_service_does_not_finish_its_backlog() -> None:
    service = service_with_backlog()
    deciding = asyncio.create_task(service.decide_or_skip())
    await asyncio.sleep(0)
    deciding.cancel()
    await asyncio.gather(deciding, return_exceptions=True)
    assert deciding.cancelled()
    assert service.aligner._next == 1
    service.close()


async def test_cooperative_decisions_equal_those_made_at_once() -> None:
    one, other = service_with_backlog(), service_with_backlog()
    at_once, cooperative = collect_decisions(one), collect_decisions(other)
    one.decide()
    await other.decide_or_skip()
    assert [decision.choices for decision in at_once] == [decision.choices for decision in cooperative]
    assert len(at_once) > 1
    one.close()
    other.close()
