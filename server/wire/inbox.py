"""From a foreign library's threads to the event loop, bounded."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from camsync import Spell

log = logging.getLogger(__name__)

PENDING_MAX = 4096
"""Messages held for a busy event loop: several seconds of a site of eight cameras."""

TURN_S = 0.02
"""How long items are handled at a time, but for the last of them: then others have their turn of the loop."""

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Message:
    """One message of the bus as it came."""

    key: str
    payload: bytes
    attachment: bytes


class Inbox(Generic[Item]):
    """Keeps the newest items and wakes the loop once for as many as have come.

    When the loop is too slow the oldest are lost and counted in ``lost``: memory never grows and the sender
    never waits. However many come, no more are handled in one turn of the loop than ``turn_s`` seconds take.
    """

    def __init__(
        self, handler: Callable[[Item], None], pending_max: int = PENDING_MAX, turn_s: float = TURN_S
    ) -> None:
        self._handler, self._turn_s = handler, turn_s
        self._loop = asyncio.get_running_loop()
        self._pending: deque[Item] = deque(maxlen=pending_max)
        self._woken = False
        self.lost = 0
        self._failing = Spell()

    @property
    def waiting(self) -> int:
        """How many items wait."""
        return len(self._pending)

    def put(self, item: Item) -> None:
        """Take an item, in any thread."""
        if len(self._pending) == self._pending.maxlen:
            self.lost += 1
        self._pending.append(item)
        if not self._woken:
            self._woken = True
            try:
                self._loop.call_soon_threadsafe(self._drain)
            except RuntimeError:
                log.debug("an item came after the event loop had closed")

    def _drain(self) -> None:
        self._woken = False
        until = time.perf_counter() + self._turn_s
        while self._pending:
            item = self._pending.popleft()
            try:
                self._handler(item)
            except Exception as error:  # one bad item must not keep back those behind it
                if (more := self._failing.happened(repr(error))) is not None:
                    log.exception("handling what came failed%s", more)
            if self._pending and time.perf_counter() >= until:
                if not self._woken:  # else whoever has put something meanwhile has seen to it
                    self._woken = True
                    self._loop.call_soon(self._drain)
                return
