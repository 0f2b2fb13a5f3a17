"""The epochs of a site: the tracking windows of all cameras end at the same pulses.

Epoch *k* is the result of the window that ends with pulse ``(k + 1) · stride - 1``. A recording that ends in
between adds an epoch that closes it.
"""

from __future__ import annotations

from datetime import UTC, datetime


def epoch_of_window(last: int, stride: int) -> int:
    """Return the epoch of a regular window that ends with pulse ``last``."""
    return last // stride


def epoch_of_recording_end(last: int, stride: int) -> int:
    """Return the extra epoch that closes a recording whose last pulse is ``last``.

    If a regular window ends with ``last``, that epoch is used already, and the closing one is the next.
    """
    return (last + 1) // stride


def end_of_epoch(epoch: int, stride: int) -> int:
    """Return the last pulse of an epoch."""
    return (epoch + 1) * stride - 1


def utc_time_of_pulse(pulse: int, fps: float, pulse0: float | None) -> str | None:
    """Return the time of a pulse in UTC (ISO 8601, milliseconds); None: unknown."""
    if pulse0 is None:
        return None
    return datetime.fromtimestamp(pulse0 + pulse / fps, UTC).isoformat(timespec="milliseconds")[:-6] + "Z"
