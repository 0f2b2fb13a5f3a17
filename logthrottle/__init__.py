"""Repeated events as few log lines.

A failing frame, message or attempt is usually followed by more that fail for the same reason, many a second.
A line for each would add nothing to the first.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["EndedEvents", "LogThrottle"]

_QUIET_S = 60.0
"""Events that have not occurred for this long count as new."""
_MAX_PAUSE_S = 3600.0
_MAX_REASONS = 8
"""New reasons logged immediately; each message may have a different one."""


@dataclass(frozen=True, slots=True)
class EndedEvents:
    """A series of events that has ended."""

    count: int
    seconds: float
    """From the first event to the end."""


class LogThrottle:
    """Throttles the log lines of one kind of event; the caller writes the lines.

    The first event is logged, then each event with a new reason, and otherwise one after one minute, two,
    four, and so on up to an hour. ``clock`` returns seconds. A series ends ``quiet_s`` seconds after its last
    event; the end is logged if any event of the series was.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic, *, quiet_s: float = _QUIET_S) -> None:
        self._clock, self._quiet_s = clock, quiet_s
        self._count = 0
        self._unlogged = 0
        self._logged = False
        self._began = self._last = self._next_at = float("-inf")
        self._pause = _QUIET_S
        self._reasons: set[str] = set()

    def record(self, reason: str = "") -> str | None:
        """Record an event; return what to append to its log line, or None if it is not to be logged."""
        now = self._clock()
        if now - self._last >= _QUIET_S:
            self._next_at, self._pause = now, _QUIET_S
            self._reasons.clear()
        if not self._count:
            self._began = now
        self._last = now
        self._count += 1
        new = reason not in self._reasons and len(self._reasons) < _MAX_REASONS
        if now < self._next_at and not new:
            self._unlogged += 1
            return None
        if new:
            self._reasons.add(reason)
        if now >= self._next_at:
            self._next_at, self._pause = now + self._pause, min(2.0 * self._pause, _MAX_PAUSE_S)
        unlogged, self._unlogged, self._logged = self._unlogged, 0, True
        times = "once" if unlogged == 1 else f"{unlogged} times"
        return f", and {times} before" if unlogged else ""

    def end(self) -> EndedEvents | None:
        """Record a success; return the series that has ended if its end is to be logged."""
        if not self._count:
            return None
        now = self._clock()
        if now - self._last < self._quiet_s:
            return None
        ended = EndedEvents(self._count, (self._last if self._quiet_s else now) - self._began)
        logged, self._logged, self._count = self._logged, False, 0
        return ended if logged else None
