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
"""Limit of one sender's queue, in messages: several seconds of the busiest camera."""
_BYTES_MAX = 1 << 26
"""Limit of one sender's queue, in bytes."""
_SENDERS_MAX = 1024
"""Limit of queues, one per sender; further senders share one."""
DRAIN_SLICE_S = 0.02
"""Seconds for which items are handled in one turn of the event loop."""

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Message:
    """One message of the bus."""

    key: str
    payload: bytes
    attachment: bytes


class Inbox(Generic[Item]):
    """Queues items by sender and passes them to a handler on the event loop, round-robin among senders.

    When the loop is too slow, a sender's oldest items are dropped and counted in ``lost``: memory is bounded,
    no sender blocks, and a sender that floods does not displace others. A sender's items stay in order. One
    turn of the loop handles items for ``turn_s`` seconds at most, or one item.

    ``sender_of`` returns the sender of an item, ``size`` its bytes.
    """

    def __init__(
        self,
        handler: Callable[[Item], None],
        pending_max: int = PENDING_MAX,
        turn_s: float = DRAIN_SLICE_S,
        *,
        sender_of: Callable[[Item], str] = lambda _: "",
        size: Callable[[Item], int] = lambda _: 0,
    ) -> None:
        self._handler, self._pending_max, self._turn_s = handler, pending_max, turn_s
        self._sender_of, self._size = sender_of, size
        self._loop = asyncio.get_running_loop()
        self._lock = threading.Lock()
        self._pending: OrderedDict[str, deque[Item]] = OrderedDict()
        """Non-empty queues by sender, in the order of their turns."""
        self._bytes: Counter[str] = Counter()
        self._is_scheduled = False
        self.lost = 0
        self._error_log = LogThrottle()

    @property
    def waiting(self) -> int:
        """The number of queued items."""
        with self._lock:
            return sum(map(len, self._pending.values()))

    def put(self, item: Item) -> None:
        """Add an item; any thread may call it."""
        with self._lock:
            self._queue(self._sender_of(item), item)
            was_scheduled, self._is_scheduled = self._is_scheduled, True
        if not was_scheduled:
            try:
                self._loop.call_soon_threadsafe(self._drain)
            except RuntimeError:
                log.debug("an item arrived after the event loop had closed")

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
        """Remove and return the next sender's oldest item; None: the queues are empty."""
        with self._lock:
            if not self._pending:
                self._is_scheduled = False
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
            except Exception as error:  # one bad item must not block the next ones
                if (more := self._error_log.record(repr(error))) is not None:
                    log.exception("handling a message failed%s", more)
            if time.perf_counter() >= until:
                self._loop.call_soon(self._drain)
                return
