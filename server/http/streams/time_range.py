"""Time ranges of requests: parse ``from=`` and ``to=``, and check that the range is recorded."""

from __future__ import annotations

import sys
from collections.abc import AsyncIterator

from aiohttp import web

from server.http.json_responses import error_response, unavailable
from server.messaging.messages import GopChoices
from server.service.facade.recordings import PlaybackRange, RecordedStream, TimeReferenceError
from server.service.service import BestViewService
from server.system.errors import reason_of


class RecordedChoices(GopChoices, frozen=True, kw_only=True):
    """The recorded decisions about a GOP: one line of the decision log."""

    run: str = ""
    """The folder of an earlier run of the service that decided; empty: this run."""


def is_time_shifted(request: web.Request) -> bool:
    """Return whether a stream is requested with from= or to=."""
    return "from" in request.query or "to" in request.query


def parse_time_range(
    request: web.Request,
    service: BestViewService,
    now: int,
    *,
    start: int | None = None,
    endless: str | None = None,
) -> PlaybackRange:
    """Parse from= and to=; ``now`` is the pulse from which seconds back are counted.

    ``start`` is the default of from=; None: from= is required. ``endless``: a to= that means no end.

    Raises:
        TimeReferenceError: a value is not a moment, or to= is not after from=.
    """
    pulses: dict[str, int] = {}
    for name in ("from", "to"):
        if name in request.query and (name, request.query[name]) != ("to", endless):
            try:
                pulses[name] = service.recordings.pulse_at(request.query[name], now)
            except TimeReferenceError as error:
                raise TimeReferenceError(f"{name}: {error}") from error
    start, end = pulses.get("from", start), pulses.get("to")
    if start is None:
        raise TimeReferenceError("from: is missing; it is the start, such as ?from=-60")
    if end is not None and end <= start:
        raise TimeReferenceError(f"to: p{end} is not after from, which is p{start}")
    return PlaybackRange(start, end)


async def forget_missing_or_refuse(
    stream: RecordedStream, start: int, end: int | None = None
) -> web.Response | None:
    """Drop index entries of deleted files at both ends of a range; return 503 if the disk is unreadable."""
    try:
        await stream.forget_missing_ends(start, end)
    except OSError as error:
        return disk_error(error)
    return None


async def refuse_unrecorded(stream: RecordedStream, playback: PlaybackRange) -> web.Response | None:
    """Return 416 with the recorded ranges if nothing of this range is recorded; None: some of it is."""
    if (unreadable := await forget_missing_or_refuse(stream, playback.start, playback.end)) is not None:
        return unreadable
    first = stream.available_from(playback.start)
    if first is not None and (playback.end is None or first < playback.end):
        return None
    try:
        await stream.forget_missing(0, sys.maxsize)
    except OSError as error:
        return disk_error(error)
    spans = stream.spans(0, sys.maxsize)
    recorded = ", ".join(f"p{span.first} to p{span.end - 1}" for span in spans) or "nothing"
    return error_response(
        416, f"nothing of {stream.name} is recorded from p{playback.start} on; there is {recorded}"
    )


async def decisions_in(
    service: BestViewService, playback: PlaybackRange
) -> AsyncIterator[bytes] | web.Response:
    """Return the recorded decisions of a range as lines of JSON; 416 if none are recorded."""
    end = service.recordings.decided_end if playback.end is None else playback.end
    lines = service.recordings.decisions(playback.start, end)
    first = await anext(lines, None)
    if first is None and playback.start < service.recordings.decided_end:
        until = "on" if playback.end is None else f"to p{playback.end - 1}"
        return error_response(416, f"no decisions are recorded from p{playback.start} {until}")
    return _prepend(first, lines)


def disk_error(error: OSError) -> web.Response:
    """Return 503 for a recording that cannot be read."""
    return unavailable(f"cannot read the recording: {reason_of(error)}")


async def _prepend(first: bytes | None, lines: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
    if first is not None:
        yield first
    async for line in lines:
        yield line
