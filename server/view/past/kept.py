"""What there is of a stream's past; days of it are not gone through to answer for one moment."""

from __future__ import annotations

import sys

from server.view.past.play import Source
from server.view.past.stretch import Span, Stretch, View, spans, views


def known(source: Source) -> list[Span]:
    """Say all that there is, on the disk and in memory."""
    found: list[Stretch | Span] = [it for one in source.recorded for it in one.tape.all]
    gop = source.recall(0)
    while gop is not None:
        found.append(Span(gop.first, gop.end))
        gop = source.recall(gop.end)
    return spans(found)


def shown(source: Source) -> list[View]:
    """Say which cameras' frames they are, as far as they are known: on the disk, and after it in memory."""
    recorded = [it for one in source.recorded for it in one.tape.all]
    return views([*recorded, *source.remembered])


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
