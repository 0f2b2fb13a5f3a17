"""What there is of a stream's past; days of it are not gone through to answer for one moment."""

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
    """Say what there is of the pulses ``start … end - 1``, on the disk and in memory."""
    found: list[IndexEntry | PulseRange] = [*_recorded(source, start, end)]
    gop = source.recall(start)
    while gop is not None and gop.first < end:
        found.append(PulseRange(gop.first, gop.end))
        gop = source.recall(gop.end)
    return [replace(it, first=max(it.first, start), end=min(it.end, end)) for it in merge_pulse_ranges(found)]


def available_camera_ranges(
    source: PlaybackSource, start: int = 0, end: int = sys.maxsize
) -> list[CameraRange]:
    """Say which cameras' frames they are, as far as they are known: on the disk, and after it in memory."""
    remembered = [it for it in source.remembered if it.end > start and it.first < end]
    found = merge_camera_ranges([*_recorded(source, start, end), *remembered])
    return [replace(it, first=max(it.first, start), end=min(it.end, end)) for it in found]


def first_available(source: PlaybackSource, pulse: int) -> int | None:
    """Give the first pulse, this one or one after it, that something is kept of; None where nothing is."""
    tapes = [it.first for one in source.recorded if (it := one.tape.at_or_after(pulse)) is not None]
    gop = source.recall(pulse)
    first = min([*tapes, *([] if gop is None else [gop.first])], default=None)
    return None if first is None else max(first, pulse)


def end_of_available(source: PlaybackSource) -> int:
    """Give the pulse after the last that is kept; 0 where nothing is."""
    tapes = [it.end for one in source.recorded if (it := one.tape.before(sys.maxsize)) is not None]
    gop = source.recall_before(sys.maxsize)
    return max([*tapes, *([] if gop is None else [gop.end])], default=0)


def _recorded(source: PlaybackSource, start: int, end: int) -> Iterator[IndexEntry]:
    for one in source.recorded:
        yield from one.tape.between(start, end)


def forget_missing_ends(source: PlaybackSource, start: int, end: int | None = None) -> None:
    """See that the first and the last of what is recorded of ``start … end - 1`` are there, or forget them.

    So what is played begins with something. Whatever is missing in between is a hole like others.

    Raises:
        OSError: nobody can tell: it may not be read, or the disk fails.
    """
    for one in source.recorded:
        ends = one.tape.at_or_after(start), one.tape.before(sys.maxsize if end is None else end)
        _check(one, {it for it in ends if it is not None})


def forget_missing(source: PlaybackSource, start: int, end: int) -> None:
    """See that all of what is recorded of ``start … end - 1`` is there, or forget what is not.

    Raises:
        OSError: nobody can tell.
    """
    for one in source.recorded:
        _check(one, {(it.camera, it.file): it for it in one.tape.between(start, end)}.values())


def _check(one: SessionEntries, stretches: Iterable[IndexEntry]) -> None:
    if not all(map(one.run.holds, stretches)):
        one.run.forget_missing()
