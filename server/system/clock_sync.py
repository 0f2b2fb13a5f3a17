"""Whether this machine's clock is synchronized (NTP)."""

from __future__ import annotations

import ctypes

_TIME_ERROR = 5
"""Returned by adjtimex(2) if the clock is not synchronized, as after it was set by hand."""
_TIMEX_BYTES = 512
"""More than struct timex has."""


def is_clock_synchronized() -> bool | None:
    """Return whether NTP keeps this machine's clock, as the system has it; None: the system does not say."""
    try:
        state: int = ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(_TIMEX_BYTES))
    except (OSError, AttributeError):
        return None
    return None if state < 0 else state != _TIME_ERROR
