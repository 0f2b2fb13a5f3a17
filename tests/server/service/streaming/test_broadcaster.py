"""Viewers share a stream; a slow one loses whole GOPs and slows no other."""

from __future__ import annotations

import asyncio
from itertools import product

import pytest

from fakes.timeouts import PATIENCE
from server.service.streaming.broadcaster import Broadcaster
from server.service.streaming.subscriber_queue import BytesChunk, Chunk


def gop(number: int) -> BytesChunk:
    return BytesChunk(b"%d" % number, random_access=True)


async def take(viewer: object, count: int) -> list[bytes]:
    received = []
    async with asyncio.timeout(PATIENCE):
        async for data in viewer:  # type: ignore[attr-defined]
            received.append(data)
            if len(received) == count:
                break
    return received


async def test_a_viewer_starts_at_once_with_the_newest_gop() -> None:
    broadcaster = Broadcaster()
    for number in range(3):
        broadcaster.publish(gop(number))
    assert await take(broadcaster.subscribe(), 1) == [b"2"]


async def test_a_viewer_of_single_frames_starts_where_the_gop_begins() -> None:
    broadcaster = Broadcaster()
    for data, start in [(b"I1", True), (b"P2", False), (b"I3", True), (b"P4", False)]:
        broadcaster.publish(BytesChunk(data, start))
    assert await take(broadcaster.subscribe(), 2) == [b"I3", b"P4"]


async def test_a_viewer_that_falls_behind_loses_whole_gops_and_others_lose_none() -> None:
    broadcaster = Broadcaster(queue_gops=3)
    slow, quick = broadcaster.subscribe(), broadcaster.subscribe()
    received = []
    for number in range(10):
        broadcaster.publish(BytesChunk(b"I%d" % number, random_access=True))
        broadcaster.publish(BytesChunk(b"P%d" % number, random_access=False))
        received += await take(quick, 2)
    assert len(received) == 20
    assert slow.lost_gops > 0
    left = await take(slow, 2)
    assert left[0][:1] == b"I", "never a broken GOP"
    assert left[1] == b"P" + left[0][1:]


async def test_memory_is_bounded_however_slow_a_viewer_is() -> None:
    broadcaster = Broadcaster(queue_gops=3)
    slow = broadcaster.subscribe()
    for number in range(1000):
        broadcaster.publish(gop(number))
    assert len(slow._queue) <= 3


async def test_the_end_comes_after_what_was_queued() -> None:
    broadcaster = Broadcaster()
    viewer = broadcaster.subscribe()
    broadcaster.publish(gop(1))
    broadcaster.close()
    async with asyncio.timeout(PATIENCE):
        assert [data async for data in viewer] == [b"1"]
    assert broadcaster.viewers == 1
    broadcaster.unsubscribe(viewer)
    assert broadcaster.viewers == 0


async def test_a_viewer_that_joins_after_the_end_receives_the_newest_gop_and_the_end() -> None:
    broadcaster = Broadcaster()
    broadcaster.publish(gop(1))
    broadcaster.close()
    async with asyncio.timeout(PATIENCE):
        assert [data async for data in broadcaster.subscribe()] == [b"1"]


@pytest.mark.parametrize("accepted", list(product([True, False], repeat=5)))
async def test_chunks_keep_their_order_whether_sent_directly_or_queued(
    accepted: tuple[bool, ...],
) -> None:
    broadcaster, sent = Broadcaster(queue_gops=10), list[bytes]()
    viewer, answers = broadcaster.subscribe(), iter(accepted)

    def send_directly(chunk: Chunk) -> bool:
        ready = next(answers)
        sent.extend([chunk.data] * ready)
        return ready

    async def send() -> None:
        async for data in viewer:
            sent.append(data)
            await asyncio.sleep(0)  # the next chunk is queued although the queue is empty

    viewer.direct_send = send_directly
    sending = asyncio.create_task(send())
    await asyncio.sleep(0)
    for number in range(5):
        broadcaster.publish(gop(number))
        if number % 2:
            await asyncio.sleep(0)
    broadcaster.close()
    async with asyncio.timeout(PATIENCE):
        await sending
    assert sent == [b"%d" % number for number in range(5)]


async def test_a_viewer_that_refuses_direct_sends_loses_whole_gops() -> None:
    broadcaster = Broadcaster(queue_gops=3)
    viewer = broadcaster.subscribe()
    viewer.direct_send = lambda _: False
    for number in range(10):
        broadcaster.publish(gop(number))
    assert viewer.lost_gops > 0
    assert len(viewer._queue) <= 3


def test_a_loss_is_reported_once() -> None:
    broadcaster = Broadcaster(queue_gops=2)
    viewer = broadcaster.subscribe()
    broadcaster.publish(BytesChunk(b"1", random_access=True))
    assert broadcaster.subscribers_with_new_loss() == []
    for number in range(4):
        broadcaster.publish(BytesChunk(b"%d" % number, random_access=True))
    assert broadcaster.subscribers_with_new_loss() == [viewer]
    assert broadcaster.subscribers_with_new_loss() == []
