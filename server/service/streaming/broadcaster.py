"""One stream to any number of viewers: bounded, and nobody slows anybody else."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from typing import Protocol


class Chunk(Protocol):
    """A piece of a stream; viewers share the bytes."""

    @property
    def data(self) -> bytes:
        """What is sent."""

    @property
    def start(self) -> bool:
        """Whether a viewer may begin here."""

    @property
    def fills(self) -> bool:
        """Whether it is a whole GOP in which there is nothing to show, and so of use to nobody who begins."""


@dataclass(frozen=True, slots=True)
class BytesChunk:
    """A piece of a stream that is just bytes."""

    data: bytes
    start: bool
    fills: bool = False


class Subscriber:
    """One viewer's place in a stream: iterate over it for the bytes to send."""

    def __init__(self, backlog: list[Chunk], starts_max: int) -> None:
        self._starts_max = starts_max
        self._queue: deque[Chunk] = deque(backlog)
        self._begun = bool(backlog)
        self._closed = False
        self._wake = asyncio.Event()
        self.at_once: Callable[[Chunk], bool] | None = None
        """Takes a piece while nothing waits, or says False; waking a task is most of what a piece costs."""
        self.lost = 0
        """GOPs lost because the viewer fell behind."""
        self._lost_before = 0

    @property
    def waiting(self) -> int:
        """How many pieces wait."""
        return len(self._queue)

    def put(self, piece: Chunk) -> None:
        """Queue a piece; whoever is too far behind loses all that waits and goes on with the next start.

        What comes before a viewer's first start is of no use to them: it is left out.
        """
        self._begun |= piece.start
        if not self._begun:
            return
        if not self._queue:
            if self.at_once is not None and self.at_once(piece):
                return
        elif (piece.start or piece.fills) and self._is_far_behind():
            self._begun = piece.start
            if not self._begun:
                return
        self._queue.append(piece)
        self._wake.set()

    def _is_far_behind(self) -> bool:
        """Whether as much waits as may; then all that waits is lost."""
        waiting = sum(queued.start or queued.fills for queued in self._queue)
        if waiting < self._starts_max:
            return False
        self._queue.clear()
        self.lost += waiting
        return True

    def has_lost(self) -> bool:
        """Whether anything was lost since this was last asked."""
        lost, self._lost_before = self.lost > self._lost_before, self.lost
        return lost

    def put_first(self, piece: Chunk) -> None:
        """Put a piece before all that waits."""
        self._begun |= piece.start
        self._queue.appendleft(piece)
        self._wake.set()

    def close(self) -> None:
        """End the stream after what is queued."""
        self._closed = True
        self._wake.set()

    async def __aiter__(self) -> AsyncIterator[bytes]:
        """Give the bytes in order until the stream ends."""
        async for piece in self.pieces():
            yield piece.data

    async def pieces(self) -> AsyncIterator[Chunk]:
        """Give the pieces in order until the stream ends."""
        while True:
            while self._queue:
                yield self._queue.popleft()
            if self._closed:
                return
            self._wake.clear()
            await self._wake.wait()


class Broadcaster:
    """Hands every piece to every viewer; whoever comes begins with the newest ``starts_kept`` starts.

    Where nothing could be shown for ``queue_starts`` GOPs, whoever comes waits for the next start instead.
    """

    def __init__(self, *, starts_kept: int = 1, queue_starts: int = 8) -> None:
        self._starts_kept = starts_kept
        self._queue_starts = queue_starts
        self._kept: deque[Chunk] = deque()
        self._viewers: set[Subscriber] = set()
        self._closed = False

    @property
    def viewers(self) -> int:
        """How many are watching."""
        return len(self._viewers)

    def publish(self, piece: Chunk) -> None:
        """Send a piece to everybody."""
        self._kept.append(piece)
        starts = sum(kept.start for kept in self._kept)
        while starts > self._starts_kept or (self._kept and not self._kept[0].start):
            starts -= self._kept.popleft().start
        if piece.fills and sum(kept.fills for kept in self._kept) > self._queue_starts:
            self._kept.clear()
        self.tell(piece)

    def tell(self, piece: Chunk) -> None:
        """Send a piece to everybody who is here now, and to nobody who comes later."""
        for viewer in self._viewers:
            viewer.put(piece)

    def join(self) -> Subscriber:
        """Let somebody in; call :meth:`leave` in the end."""
        viewer = Subscriber(list(self._kept), self._queue_starts)
        self._viewers.add(viewer)
        if self._closed:
            viewer.close()
        return viewer

    def who_lost(self) -> list[Subscriber]:
        """Give those who have lost something since this was last asked."""
        return [viewer for viewer in self._viewers if viewer.has_lost()]

    def leave(self, viewer: Subscriber) -> None:
        """Let somebody go."""
        self._viewers.discard(viewer)

    def close(self) -> None:
        """End the stream for everybody."""
        self._closed = True
        for viewer in self._viewers:
            viewer.close()
