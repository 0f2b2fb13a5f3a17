"""Offset of the server's clock, from PING and PONG as in NTP (RFC 5905, clock filter)."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

_SAMPLES = 16  # round trips, about one a second: slow drift is followed


@dataclass(frozen=True, slots=True)
class _Sample:
    offset: float
    round_trip: float


class ClockOffset:
    """The offset measured in the shortest recent round trip, which queues disturbed least."""

    def __init__(self) -> None:
        self._samples: deque[_Sample] = deque(maxlen=_SAMPLES)
        self._rough: float | None = None

    def restart(self) -> None:
        """Forget all samples: a new connection may be to another clock."""
        self._samples.clear()
        self._rough = None

    def greeted(self, server: float, received: float) -> None:
        """Use the clock in a greeting until the first PONG; it is late by the way here."""
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
