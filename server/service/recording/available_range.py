"""What there is of a stream's past; days of it are not gone through to answer for one moment."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

from server.service.recording.playback import Source
from server.service.recording.segment_index import Span, Stretch, View, spans, views


def known(source: Source, start: int = 0, end: int = sys.maxsize) -> list[Span]:
    """Say what there is of the pulses ``start … end - 1``, on the disk and in memory."""
    found: list[Stretch | Span] = [*_recorded(source, start, end)]
    gop = source.recall(start)
    while gop is not None and gop.first < end:
        found.append(Span(gop.first, gop.end))
        gop = source.recall(gop.end)
    return [replace(it, first=max(it.first, start), end=min(it.end, end)) for it in spans(found)]


def shown(source: Source, start: int = 0, end: int = sys.maxsize) -> list[View]:
    """Say which cameras' frames they are, as far as they are known: on the disk, and after it in memory."""
    remembered = [it for it in source.remembered if it.end > start and it.first < end]
    found = views([*_recorded(source, start, end), *remembered])
    return [replace(it, first=max(it.first, start), end=min(it.end, end)) for it in found]


def kept_from(source: Source, pulse: int) -> int | None:
    """Give the first pulse, this one or one after it, that something is kept of; None where nothing is."""
    tapes = [it.first for one in source.recorded if (it := one.tape.at_or_after(pulse)) is not None]
    gop = source.recall(pulse)
    first = min([*tapes, *([] if gop is None else [gop.first])], default=None)
    return None if first is None else max(first, pulse)


def kept_until(source: Source) -> int:
    """Give the pulse after the last that is kept; 0 where nothing is."""
    tapes = [it.end for one in source.recorded if (it := one.tape.before(sys.maxsize)) is not None]
    gop = source.recall_before(sys.maxsize)
    return max([*tapes, *([] if gop is None else [gop.end])], default=0)


def _recorded(source: Source, start: int, end: int) -> Iterator[Stretch]:
    for one in source.recorded:
        yield from one.tape.between(start, end)
