"""The clock of the pulses, in unix seconds that never step, and its offset to the server's clock."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

_SAMPLES = 16  # round trips, about one a second: slow drift is followed

Clock = Callable[[], float]
"""Returns the current time in unix seconds."""


def steady_unix_clock() -> Clock:
    """Return a clock in unix seconds that is set from the wall clock once and is monotonic from there.

    A wall clock that is set or stepped by NTP would shift the pulses. Where the system supports it, time
    spent suspended counts too, so that pulse numbers keep to real time.
    """
    steady = _since_boot if hasattr(time, "CLOCK_BOOTTIME") else time.monotonic
    anchor = time.time() - steady()
    return lambda: anchor + steady()


def _since_boot() -> float:
    return time.clock_gettime(time.CLOCK_BOOTTIME)


@dataclass(frozen=True, slots=True)
class _Sample:
    offset: float
    round_trip: float


class ClockOffset:
    """Offset of the server's clock, from PING and PONG as in NTP (RFC 5905, clock filter).

    It is measured in the shortest recent round trip, which queues disturbed least.
    """

    def __init__(self) -> None:
        self._samples: deque[_Sample] = deque(maxlen=_SAMPLES)
        self._rough: float | None = None

    def restart(self) -> None:
        """Discard all samples: a new connection may be to another clock."""
        self._samples.clear()
        self._rough = None

    def greeted(self, server: float, received: float) -> None:
        """Use the clock in a greeting until the first PONG; it is off by the one-way delay."""
        self._rough = server - received

    def ponged(self, sent: float, server: float, received: float) -> None:
        """Add a round trip: ``sent`` and ``received`` on the client's clock, ``server`` on the server's."""
        if received >= sent:
            self._samples.append(_Sample(server - (sent + received) / 2.0, received - sent))

    @property
    def offset(self) -> float | None:
        """Server clock minus client clock, seconds; None before the first greeting."""
        best = self._best()
        return best.offset if best else self._rough

    @property
    def round_trip(self) -> float | None:
        """The shortest recent round trip in seconds; None before the first PONG."""
        best = self._best()
        return best.round_trip if best else None

    def _best(self) -> _Sample | None:
        return min(self._samples, key=lambda sample: sample.round_trip, default=None)
