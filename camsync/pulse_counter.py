"""The count of pulses in a client: the server's where they come, its own where they do not."""

from __future__ import annotations

from collections.abc import Iterator

from camsync.messages import CountedPulse
from camsync.pulse_axis import PulseAxis


class PulseCounter:
    """Keeps the axis last heard of and the last number counted; numbers go upwards, each at most once.

    All times are unix seconds on the client's clock. ``catch_up`` is how many seconds of own pulses are made
    good after a stall; after a longer one the count goes on with the current number.
    """

    def __init__(self, fps: float, catch_up: float) -> None:
        self._fps = fps
        self._catch_up = catch_up
        self._axis: PulseAxis | None = None
        self._last: int | None = None

    @property
    def last(self) -> int | None:
        """The last number counted; None before the first."""
        return self._last

    def set_rate(self, fps: float) -> None:
        """Take the server's rate, going on from the last pulse."""
        if self._axis is not None and self._last is not None and fps != self._fps:
            self._axis = PulseAxis.through(self._last, self._axis.due(self._last), fps)
        self._fps = fps

    def gap(self, number: int, due: float) -> Iterator[tuple[int, float]]:
        """Count what is missing before pulse ``number`` of the server, unless that is more than ``catch_up``.

        A server that was stalled skips to the present; a client counting alone is behind the present by the
        time that it gives the server. What lies between is due, and a replay needs every frame.
        """
        if self._last is None or number - self._next > self._catch_up * self._fps:
            return
        axis = PulseAxis.through(number, due, self._fps)
        while self._next < number:
            self._last = self._next
            yield self._last, axis.due(self._last)

    def heard(self, number: int, due: float) -> bool:
        """Take a pulse of the server; say whether it is a new number."""
        self._axis = PulseAxis.through(number, due, self._fps)
        if self._last is not None and number <= self._last:
            return False
        self._last = number
        return True

    def begin(self, now: float) -> None:
        """Count from 0 from now on, there being no server."""
        if self._axis is None:
            self._axis = PulseAxis(now, self._fps)

    def ahead(self, now: float) -> float:
        """Return how many seconds the count is ahead of the axis: above 0 after counting alone for long."""
        if self._axis is None or self._last is None:
            return 0.0
        return self._axis.due(self._last) - now

    def known(self, now: float) -> CountedPulse | None:
        """Return the axis to restore on a server that has lost it; None before the first pulse."""
        if self._axis is None or self._last is None:
            return None
        return CountedPulse(self._last, max(0.0, now - self._axis.due(self._last)))

    def next_due(self) -> float | None:
        """Return when the next pulse is due; None while there is no axis."""
        return None if self._axis is None else self._axis.due(self._next)

    def own(self, now: float) -> Iterator[tuple[int, float]]:
        """Count the pulses due until ``now`` without the server: number and due time of each."""
        if self._axis is None:
            return
        current = self._axis.number_at(now)
        if now - self._axis.due(self._next) > self._catch_up:
            self._last = current - 1
        while self._next <= current:
            self._last = self._next
            yield self._last, self._axis.due(self._last)

    @property
    def _next(self) -> int:
        return 0 if self._last is None else self._last + 1
