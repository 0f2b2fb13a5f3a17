"""One viewer's bounded queue of stream chunks: a viewer who falls too far behind loses whole GOPs."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from typing import Protocol


class Chunk(Protocol):
    """A chunk of a stream; all subscribers share its bytes."""

    @property
    def data(self) -> bytes:
        """The bytes to send."""

    @property
    def random_access(self) -> bool:
        """Whether a subscriber may start here (random access point)."""

    @property
    def is_filler(self) -> bool:
        """Whether it only repeats an earlier picture for a whole GOP: useless to a new subscriber."""


@dataclass(frozen=True, slots=True)
class BytesChunk:
    """A chunk that is nothing but bytes, such as an event or a JPEG picture."""

    data: bytes
    random_access: bool
    is_filler: bool = False


class Subscriber:
    """One viewer's queue; iterate over it for the bytes to send.

    At most ``max_gops`` GOPs wait. When the next one comes, the subscriber loses everything queued and
    continues with the next random access point, so a slow viewer never slows down others.
    """

    def __init__(self, backlog: list[Chunk], max_gops: int) -> None:
        self._max_gops = max_gops
        self._queue: deque[Chunk] = deque(backlog)
        self._started = bool(backlog)
        self._closed = False
        self._wake = asyncio.Event()
        self.direct_send: Callable[[Chunk], bool] | None = None
        """Sends a chunk while the queue is empty, or returns False.

        It saves waking a task, which is most of the cost of a chunk.
        """
        self.lost_gops = 0
        """GOPs lost because the subscriber fell behind."""
        self._lost_gops_reported = 0

    @property
    def queued(self) -> int:
        """The number of chunks that wait."""
        return len(self._queue)

    def put(self, chunk: Chunk) -> None:
        """Queue a chunk; a subscriber that is too far behind loses the queue and resumes at the next GOP.

        Chunks before the subscriber's first random access point cannot be decoded and are skipped.
        """
        self._started |= chunk.random_access
        if not self._started:
            return
        if not self._queue:
            if self.direct_send is not None and self.direct_send(chunk):
                return
        elif (chunk.random_access or chunk.is_filler) and self._drop_if_behind():
            self._started = chunk.random_access
            if not self._started:
                return
        self._queue.append(chunk)
        self._wake.set()

    def _drop_if_behind(self) -> bool:
        """Drop the queue if it is full; return whether it was."""
        gops = sum(queued.random_access or queued.is_filler for queued in self._queue)
        if gops < self._max_gops:
            return False
        self._queue.clear()
        self.lost_gops += gops
        return True

    def has_new_loss(self) -> bool:
        """Return whether GOPs were lost since the last call."""
        lost, self._lost_gops_reported = self.lost_gops > self._lost_gops_reported, self.lost_gops
        return lost

    def put_first(self, chunk: Chunk) -> None:
        """Put a chunk in front of the queue."""
        self._started |= chunk.random_access
        self._queue.appendleft(chunk)
        self._wake.set()

    def close(self) -> None:
        """End the stream after the queued chunks."""
        self._closed = True
        self._wake.set()

    async def __aiter__(self) -> AsyncIterator[bytes]:
        """Yield the bytes in order until the stream ends."""
        async for chunk in self.chunks():
            yield chunk.data

    async def chunks(self) -> AsyncIterator[Chunk]:
        """Yield the chunks in order until the stream ends."""
        while True:
            while self._queue:
                yield self._queue.popleft()
            if self._closed:
                return
            self._wake.clear()
            await self._wake.wait()
