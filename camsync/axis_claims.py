"""Where a restarted server goes on counting: what its clients say that they have counted to, and how many do.

No client decides that alone where several are there: of what they say the median counts, the lower of two.
"""

from __future__ import annotations

import logging
from collections.abc import Collection

from camsync.clock import Clock
from camsync.limits import ServerLimits
from camsync.messages import Hello
from camsync.protocol import LAST_PULSE
from camsync.pulse_axis import PulseAxis
from logthrottle import LogThrottle

_log = logging.getLogger(__name__)
_ROOM = 2
"""A claim leaves as many numbers as it takes: centuries at any camera's rate."""
_ALONE = 2
"""Where no more clients are expected, one of them may say alone how far they have counted."""
INEXACT = 2
"""Pulses ahead that are the error of measurement, not another axis."""


class AxisClaims:
    """What the clients of one server claim, the newest word of each.

    ``expect`` are those whose word counts; nobody: everybody's does. ``fps`` is in pulses per second.
    """

    def __init__(self, fps: float, expect: Collection[str], limits: ServerLimits, clock: Clock) -> None:
        self._fps, self._expect, self._clock = fps, frozenset(expect), clock
        self._least = 1 if len(self._expect) <= _ALONE else 2
        self._most = min(LAST_PULSE // _ROOM, round(limits.counted_for * fps))
        self._epochs: dict[str, float] = {}
        """By name: when pulse 0 was due, by what they have counted."""
        self._here: frozenset[str] = frozenset()
        self._boasts, self._alone = LogThrottle(clock), LogThrottle(clock)

    def note(self, hello: Hello) -> bool:
        """Take what a client says; return whether it says how far it has counted, and could have."""
        self._epochs.pop(hello.name, None)
        if hello.known is None or (self._expect and hello.name not in self._expect):
            return False
        now = self._clock()
        axis = PulseAxis.through(hello.known.number, now - hello.known.ago, self._fps)
        number = axis.number_at(now)
        if number >= self._most:
            if (more := self._boasts.record()) is not None:
                _log.warning("%s claims to have counted to %d%s: not believed", hello.name, number, more)
            return False
        self._epochs[hello.name] = axis.epoch
        return True

    def keep(self, here: Collection[str]) -> None:
        """Forget what others said than those who are here: who has left has no say."""
        self._here = self._expect.intersection(here) if self._expect else frozenset(here)
        self._epochs = {name: epoch for name, epoch in self._epochs.items() if name in self._here}

    def agreed(self, following: PulseAxis | None = None) -> PulseAxis | None:
        """Return the axis that the clients have counted on; None: too few of them say anything.

        Once there is an axis that they are ``following``, those who are here and claim nothing speak for it.
        """
        epochs = list(self._epochs.values())
        if len(epochs) < self._least:
            return None
        if following is not None:
            epochs += [following.epoch] * (len(self._here) - len(epochs))
        return PulseAxis(sorted(epochs)[len(epochs) // 2], self._fps)

    def log_minority(self, axis: PulseAxis) -> None:
        """Log peers that claim an axis later than the one in use."""
        now = self._clock()
        number = axis.number_at(now)
        further = [
            name
            for name, epoch in self._epochs.items()
            if PulseAxis(epoch, self._fps).number_at(now) > number + INEXACT
        ]
        if further and (more := self._alone.record()) is not None:
            told = "%s: said to have counted further than to %d, which too few others say%s"
            _log.warning(told, ", ".join(sorted(further)), number, more)
