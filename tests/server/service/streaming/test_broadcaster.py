"""Viewers share a stream; whoever is slow loses whole GOPs and slows nobody."""

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
    got = []
    async with asyncio.timeout(PATIENCE):
        async for data in viewer:  # type: ignore[attr-defined]
            got.append(data)
            if len(got) == count:
                break
    return got


async def test_a_viewer_starts_at_once_with_the_newest_gop() -> None:
    channel = Broadcaster()
    for number in range(3):
        channel.publish(gop(number))
    assert await take(channel.subscribe(), 1) == [b"2"]


async def test_a_viewer_of_single_frames_starts_where_the_gop_begins() -> None:
    channel = Broadcaster()
    for data, start in [(b"I1", True), (b"P2", False), (b"I3", True), (b"P4", False)]:
        channel.publish(BytesChunk(data, start))
    assert await take(channel.subscribe(), 2) == [b"I3", b"P4"]


async def test_a_viewer_that_falls_behind_loses_whole_gops_and_others_lose_none() -> None:
    channel = Broadcaster(queue_gops=3)
    slow, quick = channel.subscribe(), channel.subscribe()
    seen = []
    for number in range(10):
        channel.publish(BytesChunk(b"I%d" % number, random_access=True))
        channel.publish(BytesChunk(b"P%d" % number, random_access=False))
        seen += await take(quick, 2)
    assert len(seen) == 20
    assert slow.lost_gops > 0
    left = await take(slow, 2)
    assert left[0][:1] == b"I", "never a broken GOP"
    assert left[1] == b"P" + left[0][1:]


async def test_memory_is_bounded_however_slow_a_viewer_is() -> None:
    channel = Broadcaster(queue_gops=3)
    slow = channel.subscribe()
    for number in range(1000):
        channel.publish(gop(number))
    assert len(slow._queue) <= 3


async def test_the_end_comes_after_what_was_queued() -> None:
    channel = Broadcaster()
    viewer = channel.subscribe()
    channel.publish(gop(1))
    channel.close()
    async with asyncio.timeout(PATIENCE):
        assert [data async for data in viewer] == [b"1"]
    assert channel.viewers == 1
    channel.unsubscribe(viewer)
    assert channel.viewers == 0


async def test_whoever_joins_after_the_end_gets_what_was_last_and_the_end() -> None:
    channel = Broadcaster()
    channel.publish(gop(1))
    channel.close()
    async with asyncio.timeout(PATIENCE):
        assert [data async for data in channel.subscribe()] == [b"1"]


@pytest.mark.parametrize("taken", list(product([True, False], repeat=5)))
async def test_pieces_keep_their_order_whether_they_are_taken_at_once_or_wait(
    taken: tuple[bool, ...],
) -> None:
    channel, sent = Broadcaster(queue_gops=10), list[bytes]()
    viewer, answers = channel.subscribe(), iter(taken)

    def take_at_once(piece: Chunk) -> bool:
        ready = next(answers)
        sent.extend([piece.data] * ready)
        return ready

    async def send() -> None:
        async for data in viewer:
            sent.append(data)
            await asyncio.sleep(0)  # what is put now has to wait, although nothing else does

    viewer.direct_send = take_at_once
    sending = asyncio.create_task(send())
    await asyncio.sleep(0)
    for number in range(5):
        channel.publish(gop(number))
        if number % 2:
            await asyncio.sleep(0)
    channel.close()
    async with asyncio.timeout(PATIENCE):
        await sending
    assert sent == [b"%d" % number for number in range(5)]


async def test_who_refuses_at_once_loses_whole_gops_as_ever() -> None:
    channel = Broadcaster(queue_gops=3)
    viewer = channel.subscribe()
    viewer.direct_send = lambda _: False
    for number in range(10):
        channel.publish(gop(number))
    assert viewer.lost_gops > 0
    assert len(viewer._queue) <= 3


def test_who_has_lost_something_is_said_once() -> None:
    channel = Broadcaster(queue_gops=2)
    viewer = channel.subscribe()
    channel.publish(BytesChunk(b"1", random_access=True))
    assert channel.subscribers_with_new_loss() == []
    for number in range(4):
        channel.publish(BytesChunk(b"%d" % number, random_access=True))
    assert channel.subscribers_with_new_loss() == [viewer]
    assert channel.subscribers_with_new_loss() == []
