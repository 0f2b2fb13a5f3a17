"""Frames of a recording that have no picture of their own, and the one line that says so."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from itertools import pairwise

from server.system.address_redaction import redact_address

log = logging.getLogger(__name__)

_MOST_SPANS = 5
"""Places that are named."""
_MOST_KEPT = 100_000
"""Frames that are remembered: who has lost more needs no list."""
_UNEVEN = 0.1
"""Part of the frames from which on missing pictures are no loss, but how the camera takes them."""


class MissingFrames:
    """Counts the frames for which an earlier picture stands; from 0, and from 1 in log lines."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._damaged: set[int] = set()
        self._missing: set[int] = set()
        self._said = False

    def damaged(self, frame: int) -> None:
        """Note a picture that could not be decoded."""
        if len(self._damaged) < _MOST_KEPT:
            self._damaged.add(frame)

    def missing(self, frames: Iterable[int]) -> None:
        """Note pictures that the recording does not have, where others come one for each frame."""
        for frame in frames:
            if len(self._missing) >= _MOST_KEPT:
                return
            self._missing.add(frame)

    def say(self, length: int, rate: float) -> None:
        """Log once, at the end of the recording, its missing frames and its true frame rate."""
        if self._said:
            return
        self._said = True
        if self._damaged:
            log.warning(
                "%s: %d damaged frames show as the picture before them: %s",
                redact_address(self._path),
                len(self._damaged),
                _named(self._damaged),
            )
        missing = self._missing - self._damaged
        if len(missing) > _UNEVEN * length:
            log.warning(
                "%s: its pictures come at uneven times (%.4g a second): each is shown when it was taken",
                redact_address(self._path),
                rate,
            )
        elif missing:
            log.warning(
                "%s: %d frames are missing from it and show as the picture before them: %s",
                redact_address(self._path),
                len(missing),
                _named(missing),
            )


def _named(frames: set[int]) -> str:
    """Name frames by their first and last: `frame 4, 31 to 60`."""
    spans = list(_spans(sorted(frames)))
    words = [f"{first + 1}" if first == last else f"{first + 1} to {last + 1}" for first, last in spans]
    more = f" and {len(words) - _MOST_SPANS} other places" if len(words) > _MOST_SPANS else ""
    return f"frame{'s' if len(frames) > 1 else ''} {', '.join(words[:_MOST_SPANS])}{more}"


def _spans(frames: list[int]) -> Iterator[tuple[int, int]]:
    first = frames[0]
    for one, other in pairwise([*frames, frames[-1] + 2]):
        if other != one + 1:
            yield first, one
            first = other
