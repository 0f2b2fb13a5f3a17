"""Tracks and choices of a time span as files, from what is kept of the past."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterator

import msgspec
from aiohttp import web

from server.http.access.grants import OPERATING
from server.http.api.handlers import problem
from server.http.app_keys import SERVICE
from server.http.streams.sending import send_bytes
from server.http.streams.time_shift import led_by, nothing_said, wish_of
from server.messaging.messages import GopChoices
from server.service.service import BestViewService
from server.service.time_shift.decision_log import read_decision_lines
from server.service.time_shift.time_reference import TimeReferenceError, utc_time_of_pulse

routes = web.RouteTableDef()

_TRACKS = "frame,time,camera,object,left,top,width,height,run"
_CHOICES = "frame,time,object,camera,run"


class Told(GopChoices, frozen=True, kw_only=True):
    """A GOP as the past tells it."""

    run: str = ""
    """Of an earlier run of the service: its folder."""


Rows = Callable[[Told, range, Callable[[int], str]], Iterator[str]]


@routes.get(f"{OPERATING}/tracks.csv")
async def get_tracks(request: web.Request) -> web.StreamResponse:
    """Give who was where from one moment to another, as CSV."""
    return await _send(request, "tracks", _TRACKS, _tracks)


@routes.get(f"{OPERATING}/choices.csv")
async def get_choices(request: web.Request) -> web.StreamResponse:
    """Give which camera showed whom from one moment to another, as CSV."""
    return await _send(request, "choices", _CHOICES, _choices)


async def _send(request: web.Request, what: str, head: str, rows: Rows) -> web.StreamResponse:
    service = request.app[SERVICE]
    end = service.past.recent.end
    try:
        wish = wish_of(request, service, end)
    except TimeReferenceError as error:
        return problem(400, str(error))
    span = range(wish.start, end if wish.end is None else wish.end)
    name = f"{service.config.site.name}-{what}-p{span.start}-p{span.stop - 1}.csv"
    headers = {"Content-Type": "text/csv", "Content-Disposition": f'attachment; filename="{name}"'}
    kept = read_decision_lines(service.past, span.start, span.stop)
    first = await anext(kept, None)
    if first is None and (missing := nothing_said(service, wish)) is not None:
        return missing
    lines = _lines(service, led_by(first, kept), span, rows)
    return await send_bytes(request, lines, f"{head}\n".encode(), headers)


async def _lines(
    service: BestViewService, told_lines: AsyncIterator[bytes], span: range, rows: Rows
) -> AsyncIterator[bytes]:
    fps, pulse0 = service.config.site.fps, service.pulse0
    decoder = msgspec.json.Decoder(Told)
    async for line in told_lines:
        gop = decoder.decode(line)
        inside = range(max(gop.first, span.start), min(gop.first + gop.frames, span.stop))
        yield "".join(rows(gop, inside, lambda pulse: utc_time_of_pulse(pulse, fps, pulse0) or "")).encode()


def _tracks(gop: Told, inside: range, moment: Callable[[int], str]) -> Iterator[str]:
    for pulse in inside:
        for camera, frames in gop.boxes.items():
            for number, left, top, right, bottom in frames[pulse - gop.first]:
                box = f"{left:.2f},{top:.2f},{right - left:.2f},{bottom - top:.2f}"
                yield f"{pulse + 1},{moment(pulse)},{camera},{number},{box},{gop.run}\n"


def _choices(gop: Told, inside: range, moment: Callable[[int], str]) -> Iterator[str]:
    for pulse in inside:
        for number, camera in sorted(gop.choices.items()):
            yield f"{pulse + 1},{moment(pulse)},{number},{camera},{gop.run}\n"
