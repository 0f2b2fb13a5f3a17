"""A bounded queue from a library's threads to the event loop, fair among senders."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections import Counter, OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from logthrottle import LogThrottle

log = logging.getLogger(__name__)

PENDING_MAX = 4096
"""Messages of one sender held for a busy event loop: several seconds of the busiest camera."""
_BYTES_MAX = 1 << 26
"""Bytes of one sender that are held for it."""
_SENDERS_MAX = 1024
"""Senders that are told apart; more of them are taken for one."""
DRAIN_SLICE_S = 0.02
"""How long items are handled at a time, but for the last of them: then others have their turn of the loop."""

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Message:
    """One message of the bus as it came."""

    key: str
    payload: bytes
    attachment: bytes


class Inbox(Generic[Item]):
    """Keeps the newest items of each sender, and hands them on in turns: one of each sender that has some.

    When the loop is too slow the oldest of a sender are lost and counted in ``lost``: memory never grows, no
    sender waits, and none who sends very much takes the places or the turns of others. A sender's own items
    stay in order. In one turn of the loop no more are handled than ``turn_s`` seconds take.

    ``whose`` says who sent an item, ``size`` how many bytes it has.
    """

    def __init__(
        self,
        handler: Callable[[Item], None],
        pending_max: int = PENDING_MAX,
        turn_s: float = DRAIN_SLICE_S,
        *,
        whose: Callable[[Item], str] = lambda _: "",
        size: Callable[[Item], int] = lambda _: 0,
    ) -> None:
        self._handler, self._pending_max, self._turn_s = handler, pending_max, turn_s
        self._whose, self._size = whose, size
        self._loop = asyncio.get_running_loop()
        self._lock = threading.Lock()
        self._pending: OrderedDict[str, deque[Item]] = OrderedDict()
        """By sender; whose turn is next is the first. No queue is empty."""
        self._bytes: Counter[str] = Counter()
        self._woken = False
        self.lost = 0
        self._failing = LogThrottle()

    @property
    def waiting(self) -> int:
        """The number of items that wait."""
        with self._lock:
            return sum(map(len, self._pending.values()))

    def put(self, item: Item) -> None:
        """Add an item; may be called in any thread."""
        with self._lock:
            self._queue(self._whose(item), item)
            woken, self._woken = self._woken, True
        if not woken:
            try:
                self._loop.call_soon_threadsafe(self._drain)
            except RuntimeError:
                log.debug("an item came after the event loop had closed")

    def _queue(self, sender: str, item: Item) -> None:
        if sender not in self._pending and len(self._pending) >= _SENDERS_MAX:
            sender = next(reversed(self._pending))
        queue = self._pending.setdefault(sender, deque())
        queue.append(item)
        self._bytes[sender] += self._size(item)
        while len(queue) > self._pending_max or (len(queue) > 1 and self._bytes[sender] > _BYTES_MAX):
            self._bytes[sender] -= self._size(queue.popleft())
            self.lost += 1

    def _take(self) -> Item | None:
        """Take the next sender's oldest item; None: none waits, and the next that comes wakes the loop."""
        with self._lock:
            if not self._pending:
                self._woken = False
                return None
            sender, queue = self._pending.popitem(last=False)
            item = queue.popleft()
            self._bytes[sender] -= self._size(item)
            if queue:
                self._pending[sender] = queue
            else:
                del self._bytes[sender]
            return item

    def _drain(self) -> None:
        until = time.perf_counter() + self._turn_s
        while (item := self._take()) is not None:
            try:
                self._handler(item)
            except Exception as error:  # one bad item must not keep back those behind it
                if (more := self._failing.record(repr(error))) is not None:
                    log.exception("handling what came failed%s", more)
            if time.perf_counter() >= until:
                self._loop.call_soon(self._drain)
                return
