"""The clock that pulses are counted on: unix seconds that never step."""

from __future__ import annotations

import time
from collections.abc import Callable

Clock = Callable[[], float]
"""Returns the current time in unix seconds."""


def steady_unix_clock() -> Clock:
    """Make a clock in unix seconds that is read from the machine's clock once and runs steadily from there.

    A wall clock that somebody sets, or that NTP steps, would move the pulses. Where the system has it, the
    time a machine spends suspended counts too, so that pulse numbers keep to real time.
    """
    steady = _since_boot if hasattr(time, "CLOCK_BOOTTIME") else time.monotonic
    anchor = time.time() - steady()
    return lambda: anchor + steady()


def _since_boot() -> float:
    return time.clock_gettime(time.CLOCK_BOOTTIME)
