"""Clock synchronization: whether NTP keeps this machine's clock."""

from __future__ import annotations

import ctypes

_TIME_ERROR = 5
"""Returned by adjtimex(2) if the clock is not synchronized, for example after it was set manually."""
_TIMEX_BYTES = 512
"""More than the size of struct timex."""


def is_clock_synchronized() -> bool | None:
    """Return whether the kernel reports the clock as synchronized; None: it does not report that."""
    try:
        state: int = ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(_TIMEX_BYTES))
    except (OSError, AttributeError):
        return None
    return None if state < 0 else state != _TIME_ERROR
