"""Detects when decisions fall behind the pulses for good."""

from __future__ import annotations

import time

from camsync.clock import Clock

_SKIP_AFTER_S = 2.0
"""Seconds that decisions may be too far behind before epochs are skipped: they may catch up."""
_CATCHES_UP = 0.95
"""Decisions catch up when the backlog has shrunk to this share."""


class BacklogMonitor:
    """Detects decisions that are too far behind the pulses to be useful, and do not catch up.

    ``max_backlog`` is how many pulses they may be behind: later, their frames are no longer buffered.
    """

    def __init__(self, max_backlog: int, clock: Clock = time.monotonic) -> None:
        self._max_backlog, self._clock = max_backlog, clock
        self._since: float | None = None
        self._backlog_before = 0

    def is_lost(self, backlog: int) -> bool:
        """Return whether to skip the waiting epochs; ``backlog`` is how many pulses decisions are behind."""
        now = self._clock()
        if backlog <= self._max_backlog:
            self._since = None
        elif self._since is None:
            self._since, self._backlog_before = now, backlog
        elif now - self._since >= _SKIP_AFTER_S:
            lost = backlog > _CATCHES_UP * self._backlog_before
            self._since, self._backlog_before = (None, 0) if lost else (now, backlog)
            return lost
        return False
