"""When to show a picture: frames that come a GOP at a time are shown one by one, at the site's rate."""

from __future__ import annotations


class Pace:
    """Gives pictures their moments. ``most`` is how many seconds a picture is kept back at the longest."""

    def __init__(self, fps: float, most: float) -> None:
        self._fps, self._most = fps, most
        self._zero: float | None = None

    def due(self, pulse: int, now: float) -> float:
        """Give the moment, in the seconds of ``now``, which rises: as long after the last as pulses tell.

        A picture that comes too late is shown now, and what follows is later by as much. What would have to
        wait too long, since what lay between did not come, is shown now, and what follows is earlier.
        """
        after = pulse / self._fps
        if self._zero is None or not now <= self._zero + after <= now + self._most:
            self._zero = now - after
        return self._zero + after
