"""Which pulses of a stream can be played, from disk and memory, and whether their files still exist."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace

from server.service.recording.segment_index import (
    CameraRange,
    IndexEntry,
    PulseRange,
    merge_camera_ranges,
    merge_pulse_ranges,
)
from server.service.time_shift.playback import PlaybackSource, SessionEntries


def available_ranges(source: PlaybackSource, start: int = 0, end: int = sys.maxsize) -> list[PulseRange]:
    """Return which of the pulses ``start … end - 1`` can be played, from the disk or from memory."""
    ranges: list[IndexEntry | PulseRange] = [*_recorded(source, start, end)]
    gop = source.gop_in_memory_from(start)
    while gop is not None and gop.first < end:
        ranges.append(PulseRange(gop.first, gop.end))
        gop = source.gop_in_memory_from(gop.end)
    return [
        replace(span, first=max(span.first, start), end=min(span.end, end))
        for span in merge_pulse_ranges(ranges)
    ]


def available_camera_ranges(
    source: PlaybackSource, start: int = 0, end: int = sys.maxsize
) -> list[CameraRange]:
    """Return the playable ranges by camera shown: entries on the disk, then decisions in memory."""
    in_memory = [span for span in source.ranges_in_memory if span.end > start and span.first < end]
    ranges = merge_camera_ranges([*_recorded(source, start, end), *in_memory])
    return [replace(span, first=max(span.first, start), end=min(span.end, end)) for span in ranges]


def first_available(source: PlaybackSource, pulse: int) -> int | None:
    """Return the first pulse from this one on that can be played; None if there is none.

    Only the ends of indexes are read: a recording may be days long.
    """
    firsts = [
        entry.first
        for recorded in source.recorded
        if (entry := recorded.index.at_or_after(pulse)) is not None
    ]
    gop = source.gop_in_memory_from(pulse)
    first = min([*firsts, *([] if gop is None else [gop.first])], default=None)
    return None if first is None else max(first, pulse)


def end_of_available(source: PlaybackSource) -> int:
    """Return the pulse after the last that can be played; 0 if there is none."""
    firsts = [
        entry.end for recorded in source.recorded if (entry := recorded.index.before(sys.maxsize)) is not None
    ]
    gop = source.gop_in_memory_until(sys.maxsize)
    return max([*firsts, *([] if gop is None else [gop.end])], default=0)


def _recorded(source: PlaybackSource, start: int, end: int) -> Iterator[IndexEntry]:
    for recorded in source.recorded:
        yield from recorded.index.between(start, end)


def forget_missing_ends(source: PlaybackSource, start: int, end: int | None = None) -> None:
    """Check the first and the last files of the pulses ``start … end - 1``; drop entries without a file.

    So playback begins with a picture; what is missing in between is a gap like others.

    Raises:
        OSError: it cannot be determined: no permission, or the disk fails.
    """
    for recorded in source.recorded:
        ends = recorded.index.at_or_after(start), recorded.index.before(sys.maxsize if end is None else end)
        _check(recorded, {entry for entry in ends if entry is not None})


def forget_missing(source: PlaybackSource, start: int, end: int) -> None:
    """Check all files of the pulses ``start … end - 1``; drop entries without a file.

    Raises:
        OSError: it cannot be determined.
    """
    for recorded in source.recorded:
        _check(
            recorded,
            {(entry.camera, entry.file): entry for entry in recorded.index.between(start, end)}.values(),
        )


def _check(recorded: SessionEntries, entries: Iterable[IndexEntry]) -> None:
    if not all(map(recorded.session.has_file_of, entries)):
        recorded.session.forget_missing_entries()
