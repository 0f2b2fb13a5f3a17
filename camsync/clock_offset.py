"""How far the server's clock is from ours, from PING and PONG as NTP does it (RFC 5905, clock filter)."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

_SAMPLES = 16  # as many round trips are remembered: about as many seconds, so slow drift is followed


@dataclass(frozen=True, slots=True)
class _Sample:
    offset: float
    round_trip: float


class ClockOffset:
    """The offset of the sample with the shortest round trip: the one that queues disturbed least."""

    def __init__(self) -> None:
        self._samples: deque[_Sample] = deque(maxlen=_SAMPLES)
        self._rough: float | None = None

    def restart(self) -> None:
        """Forget everything: another server, another clock."""
        self._samples.clear()
        self._rough = None

    def greeted(self, server: float, received: float) -> None:
        """Take the clock in a greeting: right up to the way here; good until the first PONG."""
        self._rough = server - received

    def ponged(self, sent: float, server: float, received: float) -> None:
        """Take one round trip: sent and received by our clock, answered at ``server`` by theirs (seconds)."""
        if received >= sent:
            self._samples.append(_Sample(server - (sent + received) / 2.0, received - sent))

    @property
    def offset(self) -> float | None:
        """Server clock minus ours, in seconds; None before a server was heard."""
        best = self._best()
        return best.offset if best else self._rough

    @property
    def round_trip(self) -> float | None:
        """The shortest recent round trip in seconds; None before the first PONG."""
        best = self._best()
        return best.round_trip if best else None

    def _best(self) -> _Sample | None:
        return min(self._samples, key=lambda sample: sample.round_trip, default=None)
