"""The pulse schedule that a restarted server continues: the median of its clients' claimed counts.

If several clients are connected, no single one decides. Of two claims the lower one counts.
"""

from __future__ import annotations

import logging
from collections.abc import Collection

from camsync.clock import Clock
from camsync.limits import ServerLimits
from camsync.messages import Hello
from camsync.protocol import LAST_PULSE
from camsync.pulse_schedule import PulseSchedule
from logthrottle import LogThrottle

_log = logging.getLogger(__name__)
_HEADROOM = 2
"""A claim may use up half of all pulse numbers: centuries remain at any camera's rate."""
_SMALL_SITE = 2
"""Expected clients up to which a single claim is enough."""
MEASUREMENT_ERROR = 2
"""Pulses by which two claims of the same schedule may differ."""


class ScheduleClaims:
    """The newest claim of each client of one server.

    ``expect`` names the clients whose claims count; empty: all clients. ``fps`` is in pulses per second.
    """

    def __init__(self, fps: float, expect: Collection[str], limits: ServerLimits, clock: Clock) -> None:
        self._fps, self._expect, self._clock = fps, frozenset(expect), clock
        self._required_claims = 1 if len(self._expect) <= _SMALL_SITE else 2
        self._max_number = min(LAST_PULSE // _HEADROOM, round(limits.counted_for * fps))
        self._epochs: dict[str, float] = {}
        """By client name: when pulse 0 was due on the claimed schedule."""
        self._connected: frozenset[str] = frozenset()
        self._implausible, self._claims_ahead = LogThrottle(clock), LogThrottle(clock)

    def record(self, hello: Hello) -> bool:
        """Record a client's claim, if it has a plausible one and its claims count; return whether it does."""
        self._epochs.pop(hello.name, None)
        if hello.known is None or (self._expect and hello.name not in self._expect):
            return False
        now = self._clock()
        schedule = PulseSchedule.through(hello.known.number, now - hello.known.ago, self._fps)
        number = schedule.number_at(now)
        if number >= self._max_number:
            if (more := self._implausible.record()) is not None:
                _log.warning("%s claims to have counted to %d%s: claim ignored", hello.name, number, more)
            return False
        self._epochs[hello.name] = schedule.epoch
        return True

    def keep_only(self, connected: Collection[str]) -> None:
        """Drop the claims of clients that are no longer connected."""
        self._connected = self._expect.intersection(connected) if self._expect else frozenset(connected)
        self._epochs = {name: epoch for name, epoch in self._epochs.items() if name in self._connected}

    def median_schedule(self, current: PulseSchedule | None = None) -> PulseSchedule | None:
        """Return the schedule of the median claim; None: too few claims.

        Connected clients without a claim count for the server's ``current`` schedule, if there is one.
        """
        epochs = list(self._epochs.values())
        if len(epochs) < self._required_claims:
            return None
        if current is not None:
            epochs += [current.epoch] * (len(self._connected) - len(epochs))
        return PulseSchedule(sorted(epochs)[len(epochs) // 2], self._fps)

    def log_claims_ahead(self, schedule: PulseSchedule) -> None:
        """Log the clients that claim to have counted further than ``schedule``."""
        now = self._clock()
        number = schedule.number_at(now)
        ahead = [
            name
            for name, epoch in self._epochs.items()
            if PulseSchedule(epoch, self._fps).number_at(now) > number + MEASUREMENT_ERROR
        ]
        if ahead and (more := self._claims_ahead.record()) is not None:
            text = "%s: claimed to have counted further than %d, but too few other clients do%s"
            _log.warning(text, ", ".join(sorted(ahead)), number, more)
