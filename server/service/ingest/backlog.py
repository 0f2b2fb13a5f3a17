"""Whether the service decides as fast as there is something to decide."""

from __future__ import annotations

import time

from camsync.clock import Clock

_PATIENCE_S = 2.0
"""For how long being too far behind is looked at before anything is left out: it may be made up for."""
_CATCHES_UP = 0.95
"""Being behind by less than this part of what it was is catching up."""


class BacklogMonitor:
    """Detects decisions that are too far behind the pulses to be useful, and do not catch up.

    ``reach`` is by how many pulses they may be behind: what is decided later is of pictures that are gone.
    """

    def __init__(self, reach: int, clock: Clock = time.monotonic) -> None:
        self._reach, self._clock = reach, clock
        self._since: float | None = None
        self._by = 0

    def is_lost(self, behind: int) -> bool:
        """Return whether to skip what waits; ``behind`` is by how many pulses decisions are late."""
        now = self._clock()
        if behind <= self._reach:
            self._since = None
        elif self._since is None:
            self._since, self._by = now, behind
        elif now - self._since >= _PATIENCE_S:
            lost = behind > _CATCHES_UP * self._by
            self._since, self._by = (None, 0) if lost else (now, behind)
            return lost
        return False
