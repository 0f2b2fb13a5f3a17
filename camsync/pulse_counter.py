"""A client's count of pulses: the server's while they arrive, its own while they do not."""

from __future__ import annotations

from collections.abc import Iterator

from camsync.messages import CountedPulse
from camsync.pulse_schedule import PulseSchedule


class PulseCounter:
    """Holds the server's last known axis and the last number counted. Numbers rise, each at most once.

    All times are unix seconds on the client's clock. After a stall of up to ``catch_up`` seconds the missed
    pulses are counted; after a longer one the count skips to the current number.
    """

    def __init__(self, fps: float, catch_up: float) -> None:
        self._fps = fps
        self._catch_up = catch_up
        self._axis: PulseSchedule | None = None
        self._last: int | None = None

    @property
    def last(self) -> int | None:
        """The last number counted; None before the first."""
        return self._last

    def set_rate(self, fps: float) -> None:
        """Set the server's rate, from the last pulse on."""
        if self._axis is not None and self._last is not None and fps != self._fps:
            self._axis = PulseSchedule.through(self._last, self._axis.due(self._last), fps)
        self._fps = fps

    def fill_gap(self, number: int, due: float) -> Iterator[tuple[int, float]]:
        """Count the pulses missing before the server's pulse ``number``, unless longer than ``catch_up``.

        A server that was stalled skips to the present, and a client counting by itself waits ``own_after``
        before each pulse. A replay needs every frame, so the pulses between are made up for.
        """
        if self._last is None or number - self._next > self._catch_up * self._fps:
            return
        axis = PulseSchedule.through(number, due, self._fps)
        while self._next < number:
            self._last = self._next
            yield self._last, axis.due(self._last)

    def accept(self, number: int, due: float) -> bool:
        """Count a pulse of the server; return whether its number is new."""
        self._axis = PulseSchedule.through(number, due, self._fps)
        if self._last is not None and number <= self._last:
            return False
        self._last = number
        return True

    def start_at(self, now: float) -> None:
        """Start an axis of its own, with pulse 0 now, unless a server's axis is known."""
        if self._axis is None:
            self._axis = PulseSchedule(now, self._fps)

    def ahead(self, now: float) -> float:
        """Return by how many seconds the count is ahead of the server's axis."""
        if self._axis is None or self._last is None:
            return 0.0
        return self._axis.due(self._last) - now

    def known(self, now: float) -> CountedPulse | None:
        """Return the last pulse counted, for a restarted server; None before the first."""
        if self._axis is None or self._last is None:
            return None
        return CountedPulse(self._last, max(0.0, now - self._axis.due(self._last)))

    def next_due(self) -> float | None:
        """Return when the next pulse is due; None while there is no axis."""
        return None if self._axis is None else self._axis.due(self._next)

    def count_own(self, now: float) -> Iterator[tuple[int, float]]:
        """Count the pulses due until ``now`` without the server; yield number and due time of each."""
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
