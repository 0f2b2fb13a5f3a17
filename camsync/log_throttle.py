"""What happens again and again, told as one event: it begins, seldom that it goes on, and it is over.

A frame, a message or an attempt that fails is followed by the next one that does: a line of the log for each
would be many a second, and would say nothing that the first one did not.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from camsync.clock import Clock

_CALM = 60.0
"""What has not happened for so many seconds begins anew."""
_PAUSE_MOST = 3600.0
_REASONS_MOST = 8
"""Reasons of one spell that are told as they come: there may be as many as there are messages."""


@dataclass(frozen=True, slots=True)
class Ended:
    """A spell that is over: how often it happened, and in how many seconds."""

    times: int
    seconds: float


class Spell:
    """Says when to tell of something that happens again and again; what is said is the caller's.

    At once; then for a reason that it had not before, and else after one minute, two, four, and so on up to
    an hour. That it is over is told when all has been well for ``calm`` seconds, if its beginning was.
    """

    def __init__(self, clock: Clock = time.monotonic, *, calm: float = _CALM) -> None:
        self._clock, self._calm = clock, calm
        self._times = 0
        """How often it has happened since all was well."""
        self._untold = 0
        self._told = False
        """Whether that is known to who reads the log."""
        self._began = self._last = self._again_at = float("-inf")
        self._pause = _CALM
        self._reasons: set[str] = set()

    def happened(self, why: str = "") -> str | None:
        """Note that it has; give the end of the line that tells it, or None: it is not to be told now."""
        now = self._clock()
        if now - self._last >= _CALM:
            self._again_at, self._pause = now, _CALM
            self._reasons.clear()
        if not self._times:
            self._began = now
        self._last = now
        self._times += 1
        new = why not in self._reasons and len(self._reasons) < _REASONS_MOST
        if now < self._again_at and not new:
            self._untold += 1
            return None
        if new:
            self._reasons.add(why)
        if now >= self._again_at:
            self._again_at, self._pause = now + self._pause, min(2.0 * self._pause, _PAUSE_MOST)
        untold, self._untold, self._told = self._untold, 0, True
        times = "once" if untold == 1 else f"{untold} times"
        return f", and {times} before" if untold else ""

    def over(self) -> Ended | None:
        """Note that all is well; give what is over, where that is to be told now."""
        if not self._times:
            return None
        now = self._clock()
        if now - self._last < self._calm:
            return None
        ended = Ended(self._times, (self._last if self._calm else now) - self._began)
        told, self._times, self._told = self._told, 0, False
        return ended if told else None
