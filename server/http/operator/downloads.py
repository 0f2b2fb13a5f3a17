"""``/api/operator/tracks.csv`` and ``choices.csv``: recorded decisions of a time range as CSV files."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterator

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SERVICE
from server.http.json_responses import error_response
from server.http.streams.sending import send_bytes
from server.http.streams.time_range import decisions_in, parse_time_range
from server.messaging.messages import GopChoices
from server.service.facade.recordings import TimeReferenceError
from server.service.service import BestViewService

routes = web.RouteTableDef()

_TRACKS = "frame,time,camera,object,left,top,width,height,run"
_CHOICES = "frame,time,object,camera,run"


class RecordedChoices(GopChoices, frozen=True, kw_only=True):
    """The recorded decisions about a GOP."""

    run: str = ""
    """The folder of the earlier run of the service that it is of; empty: of this one."""


RowWriter = Callable[[RecordedChoices, range, Callable[[int], str]], Iterator[str]]
"""Yields the rows of a GOP for the given pulses, with a function that returns the time of a pulse."""


@routes.get(f"{OPERATOR_PATH}/tracks.csv")
async def get_tracks(request: web.Request) -> web.StreamResponse:
    """Return everybody's positions between two moments, as CSV."""
    return await _send(request, "tracks", _TRACKS, _tracks)


@routes.get(f"{OPERATOR_PATH}/choices.csv")
async def get_choices(request: web.Request) -> web.StreamResponse:
    """Return the selected views between two moments, as CSV."""
    return await _send(request, "choices", _CHOICES, _choices)


async def _send(request: web.Request, what: str, head: str, rows: RowWriter) -> web.StreamResponse:
    service = request.app[SERVICE]
    end = service.recordings.end
    try:
        playback = parse_time_range(request, service, end)
    except TimeReferenceError as error:
        return error_response(400, str(error))
    span = range(playback.start, end if playback.end is None else playback.end)
    name = f"{service.config.site.name}-{what}-p{span.start}-p{span.stop - 1}.csv"
    headers = {"Content-Type": "text/csv", "Content-Disposition": f'attachment; filename="{name}"'}
    decisions = await decisions_in(service, playback)
    if isinstance(decisions, web.Response):
        return decisions
    lines = _csv_lines(service, decisions, span, rows)
    return await send_bytes(request, lines, f"{head}\n".encode(), headers)


async def _csv_lines(
    service: BestViewService, decisions: AsyncIterator[bytes], span: range, rows: RowWriter
) -> AsyncIterator[bytes]:
    decoder = msgspec.json.Decoder(RecordedChoices)
    async for line in decisions:
        gop = decoder.decode(line)
        inside = range(max(gop.first, span.start), min(gop.first + gop.frames, span.stop))
        yield "".join(rows(gop, inside, lambda pulse: service.recordings.time_of(pulse) or "")).encode()


def _tracks(gop: RecordedChoices, inside: range, time_of: Callable[[int], str]) -> Iterator[str]:
    for pulse in inside:
        for camera, frames in gop.boxes.items():
            for number, left, top, right, bottom in frames[pulse - gop.first]:
                box = f"{left:.2f},{top:.2f},{right - left:.2f},{bottom - top:.2f}"
                yield f"{pulse + 1},{time_of(pulse)},{camera},{number},{box},{gop.run}\n"


def _choices(gop: RecordedChoices, inside: range, time_of: Callable[[int], str]) -> Iterator[str]:
    for pulse in inside:
        for number, camera in sorted(gop.choices.items()):
            yield f"{pulse + 1},{time_of(pulse)},{number},{camera},{gop.run}\n"
