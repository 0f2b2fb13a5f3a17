"""Parses the time references of URLs: seconds ago (``-60``), a pulse (``p1250``), or a date and time."""

from __future__ import annotations

import math
import re
from datetime import UTC, datetime

_BACK = re.compile(r"-([0-9]{1,9}(?:\.[0-9]{1,9})?)")
_PULSE = re.compile(r"p([0-9]{1,13})")
_OFFSET = re.compile(r" (?=[0-9]{2}:?[0-9]{2}$)")
"""A plus sign in a URL that was not escaped has become a space."""

_TOLERANCE = 1e-3
"""Tolerance in frames: floats hold the time of day to a microsecond."""


class TimeReferenceError(ValueError):
    """A text is not a time reference; the message describes the valid forms."""


def parse_time_reference(text: str, *, now: int, fps: float, pulse0: float | None) -> int:
    """Return the pulse of a text: ``-60`` (seconds before pulse ``now``), ``p1250`` or ISO 8601.

    ``pulse0`` is when pulse 0 was due, unix seconds. A time without an offset is UTC. Times before pulse 0
    become pulse 0.

    Raises:
        TimeReferenceError: it cannot be parsed.
    """
    if match := _BACK.fullmatch(text):
        return max(0, now - round(float(match[1]) * fps))
    if match := _PULSE.fullmatch(text):
        return int(match[1])
    try:
        moment = datetime.fromisoformat(_OFFSET.sub("+", text))
    except ValueError:
        raise TimeReferenceError(
            f"{text!r} is not a time; use seconds ago (-60), a pulse (p1250) or a time (2026-11-21T16:13:36Z)"
        ) from None
    if pulse0 is None:
        raise TimeReferenceError("no pulse has been received yet; use seconds ago (-60) or a pulse (p1250)")
    seconds = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp() - pulse0
    return max(0, math.floor(seconds * fps + _TOLERANCE))
