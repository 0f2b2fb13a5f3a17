"""A recording's damaged and missing frames, and the log lines about them."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from itertools import pairwise

from server.system.address_redaction import redact_to_host

log = logging.getLogger(__name__)

_MAX_SPANS = 5
"""Spans to list in a log line."""
_MAX_FRAMES = 100_000
"""Frames to remember of each kind."""
_UNEVEN = 0.1
"""Share of missing frames from which the frame rate is reported as uneven instead."""


class MissingFrames:
    """Collects the frames that repeat an earlier one; numbered from 0, in log lines from 1."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._damaged: set[int] = set()
        self._missing: set[int] = set()
        self._is_logged = False

    def add_damaged(self, frame: int) -> None:
        """Add a frame that could not be decoded."""
        if len(self._damaged) < _MAX_FRAMES:
            self._damaged.add(frame)

    def add_missing(self, frames: Iterable[int]) -> None:
        """Add frames that the recording does not have."""
        for frame in frames:
            if len(self._missing) >= _MAX_FRAMES:
                return
            self._missing.add(frame)

    def log_summary(self, length: int, rate: float) -> None:
        """Log once, at the end of the recording, its missing frames and its true frame rate."""
        if self._is_logged:
            return
        self._is_logged = True
        if self._damaged:
            log.warning(
                "%s: %d damaged frames are replaced by the previous one: %s",
                redact_to_host(self._path),
                len(self._damaged),
                _format_spans(self._damaged),
            )
        missing = self._missing - self._damaged
        if len(missing) > _UNEVEN * length:
            log.warning(
                "%s: its frame rate is uneven (%.4g a second): each frame is shown at its own time",
                redact_to_host(self._path),
                rate,
            )
        elif missing:
            log.warning(
                "%s: %d frames are missing and replaced by the previous one: %s",
                redact_to_host(self._path),
                len(missing),
                _format_spans(missing),
            )


def _format_spans(frames: set[int]) -> str:
    """Return frames as text, in spans: `frames 4, 31 to 60`."""
    spans = list(_spans(sorted(frames)))
    spans_text = [f"{first + 1}" if first == last else f"{first + 1} to {last + 1}" for first, last in spans]
    more = f" and {len(spans_text) - _MAX_SPANS} other places" if len(spans_text) > _MAX_SPANS else ""
    return f"frame{'s' if len(frames) > 1 else ''} {', '.join(spans_text[:_MAX_SPANS])}{more}"


def _spans(frames: list[int]) -> Iterator[tuple[int, int]]:
    first = frames[0]
    for frame, following in pairwise([*frames, frames[-1] + 2]):
        if following != frame + 1:
            yield first, frame
            first = following
