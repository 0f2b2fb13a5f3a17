"""The arithmetic of pulses: which pulse is due when, and how a client counts them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from camsync.messages import CountedPulse


@dataclass(frozen=True, slots=True)
class PulseSchedule:
    """Pulse n is due at ``epoch + n / fps``: computed from n, so that errors do not accumulate.

    ``epoch`` is when pulse 0 was due (unix seconds on one clock), ``fps`` the pulses per second.
    """

    epoch: float
    fps: float

    @classmethod
    def through(cls, number: int, due: float, fps: float) -> PulseSchedule:
        """Return the schedule by which pulse ``number`` is due at ``due``."""
        return cls(due - number / fps, fps)

    def due(self, number: int) -> float:
        """Return when pulse ``number`` is due."""
        return self.epoch + number / self.fps

    def number_at(self, time: float) -> int:
        """Return the last pulse due at or before ``time``: negative before the epoch."""
        number = math.floor((time - self.epoch) * self.fps)
        # The product is rounded differently from the quotient in due(): agree with due() exactly.
        while self.due(number) > time:
            number -= 1
        while self.due(number + 1) <= time:
            number += 1
        return number


class PulseCounter:
    """A client's count of pulses: the server's while they arrive, locally generated ones while they do not.

    Holds the server's last known schedule and the last number counted. Numbers rise, each at most once.

    All times are unix seconds on the client's clock. After a stall of up to ``catch_up`` seconds the missed
    pulses are counted; after a longer one the count skips to the current number.
    """

    def __init__(self, fps: float, catch_up: float) -> None:
        self._fps = fps
        self._catch_up = catch_up
        self._schedule: PulseSchedule | None = None
        self._last: int | None = None

    @property
    def last(self) -> int | None:
        """The last number counted; None before the first."""
        return self._last

    def set_rate(self, fps: float) -> None:
        """Set the server's rate, from the last pulse on."""
        if self._schedule is not None and self._last is not None and fps != self._fps:
            self._schedule = PulseSchedule.through(self._last, self._schedule.due(self._last), fps)
        self._fps = fps

    def fill_gap(self, number: int, due: float) -> Iterator[tuple[int, float]]:
        """Count the pulses missing before the server's pulse ``number``, unless longer than ``catch_up``.

        A server that was stalled skips to the current pulse, and a client that generates pulses waits
        ``local_after`` before each. A replay needs every frame, so the pulses between are generated.
        """
        if self._last is None or number - self._next > self._catch_up * self._fps:
            return
        schedule = PulseSchedule.through(number, due, self._fps)
        while self._next < number:
            self._last = self._next
            yield self._last, schedule.due(self._last)

    def accept(self, number: int, due: float) -> bool:
        """Count a pulse of the server; return whether its number is new."""
        self._schedule = PulseSchedule.through(number, due, self._fps)
        if self._last is not None and number <= self._last:
            return False
        self._last = number
        return True

    def start_at(self, now: float) -> None:
        """Start a local schedule, with pulse 0 now, unless the server's schedule is known."""
        if self._schedule is None:
            self._schedule = PulseSchedule(now, self._fps)

    def ahead(self, now: float) -> float:
        """Return by how many seconds the count is ahead of the server's schedule."""
        if self._schedule is None or self._last is None:
            return 0.0
        return self._schedule.due(self._last) - now

    def known(self, now: float) -> CountedPulse | None:
        """Return the last pulse counted, for a restarted server; None before the first."""
        if self._schedule is None or self._last is None:
            return None
        return CountedPulse(self._last, max(0.0, now - self._schedule.due(self._last)))

    def next_due(self) -> float | None:
        """Return when the next pulse is due; None if there is no schedule."""
        return None if self._schedule is None else self._schedule.due(self._next)

    def count_local(self, now: float) -> Iterator[tuple[int, float]]:
        """Generate the pulses due until ``now``; yield the number and due time of each."""
        if self._schedule is None:
            return
        current = self._schedule.number_at(now)
        if now - self._schedule.due(self._next) > self._catch_up:
            self._last = current - 1
        while self._next <= current:
            self._last = self._next
            yield self._last, self._schedule.due(self._last)

    @property
    def _next(self) -> int:
        return 0 if self._last is None else self._last + 1
