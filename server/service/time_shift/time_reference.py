"""Moments as addresses name them: seconds back, a pulse, or a time of day."""

from __future__ import annotations

import math
import re
from datetime import UTC, datetime

_BACK = re.compile(r"-([0-9]{1,9}(?:\.[0-9]{1,9})?)")
_PULSE = re.compile(r"p([0-9]{1,13})")
_OFFSET = re.compile(r" (?=[0-9]{2}:?[0-9]{2}$)")
"""A plus sign in an address that was not escaped has become a space."""

_FLOAT = 1e-3
"""Frames by which a time may seem to be before its pulse: floats know the time of day to a microsecond."""


class TimeReferenceError(ValueError):
    """It is no moment; the text says in one line what one looks like."""


def parse_time_reference(text: str, *, now: int, fps: float, pulse0: float | None) -> int:
    """Give the pulse that a text names: ``-60`` (seconds before pulse ``now``), ``p1250`` or ISO 8601.

    ``pulse0`` is when pulse 0 was due, unix seconds. A time without an offset is UTC. What was before pulse 0
    is pulse 0.

    Raises:
        MomentError: it names none.
    """
    if found := _BACK.fullmatch(text):
        return max(0, now - round(float(found[1]) * fps))
    if found := _PULSE.fullmatch(text):
        return int(found[1])
    try:
        moment = datetime.fromisoformat(_OFFSET.sub("+", text))
    except ValueError:
        raise TimeReferenceError(
            f"{text!r} is no moment; say seconds back (-60), a pulse (p1250) or a time (2026-11-21T16:13:36Z)"
        ) from None
    if pulse0 is None:
        raise TimeReferenceError(
            "the time of no pulse is known yet; say seconds back (-60) or a pulse (p1250)"
        )
    seconds = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp() - pulse0
    return max(0, math.floor(seconds * fps + _FLOAT))


def utc_time_of_pulse(pulse: int, fps: float, pulse0: float | None) -> str | None:
    """Give the time of a pulse in UTC (ISO 8601, milliseconds); None where it is not known."""
    if pulse0 is None:
        return None
    return datetime.fromtimestamp(pulse0 + pulse / fps, UTC).isoformat(timespec="milliseconds")[:-6] + "Z"
