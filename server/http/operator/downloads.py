"""``/api/operator/tracks.csv`` and ``choices.csv``: recorded decisions of a time range as CSV files."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterator

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SERVICE
from server.http.json_responses import error_response
from server.http.streams.sending import send_bytes
from server.http.streams.time_range import RecordedChoices, decisions_in, parse_time_range
from server.service.facade.recordings import TimeReferenceError
from server.service.service import BestViewService

routes = web.RouteTableDef()

_TRACKS = "frame,time,camera,object,left,top,width,height,run"
_CHOICES = "frame,time,object,camera,run"


RowWriter = Callable[[RecordedChoices, range, Callable[[int], str]], Iterator[str]]
"""Yields the CSV rows of a GOP for the given pulses; the function returns the time of a pulse."""


@routes.get(f"{OPERATOR_PATH}/tracks.csv")
async def get_tracks(request: web.Request) -> web.StreamResponse:
    """Return all tracked boxes in a time range as CSV."""
    return await _send(request, "tracks", _TRACKS, _tracks)


@routes.get(f"{OPERATOR_PATH}/choices.csv")
async def get_choices(request: web.Request) -> web.StreamResponse:
    """Return the selected views in a time range as CSV."""
    return await _send(request, "choices", _CHOICES, _choices)


async def _send(request: web.Request, kind: str, header: str, rows: RowWriter) -> web.StreamResponse:
    service = request.app[SERVICE]
    end = service.recordings.decided_end
    try:
        playback = parse_time_range(request, service, end)
    except TimeReferenceError as error:
        return error_response(400, str(error))
    pulse_range = range(playback.start, end if playback.end is None else playback.end)
    name = f"{service.config.site.name}-{kind}-p{pulse_range.start}-p{pulse_range.stop - 1}.csv"
    headers = {"Content-Type": "text/csv", "Content-Disposition": f'attachment; filename="{name}"'}
    decisions = await decisions_in(service, playback)
    if isinstance(decisions, web.Response):
        return decisions
    lines = _csv_lines(service, decisions, pulse_range, rows)
    return await send_bytes(request, lines, f"{header}\n".encode(), headers)


async def _csv_lines(
    service: BestViewService, decisions: AsyncIterator[bytes], pulse_range: range, rows: RowWriter
) -> AsyncIterator[bytes]:
    decoder = msgspec.json.Decoder(RecordedChoices)
    async for line in decisions:
        gop = decoder.decode(line)
        pulses = range(max(gop.first, pulse_range.start), min(gop.first + gop.frames, pulse_range.stop))
        yield "".join(rows(gop, pulses, lambda pulse: service.recordings.time_of(pulse) or "")).encode()


def _tracks(gop: RecordedChoices, pulses: range, time_of: Callable[[int], str]) -> Iterator[str]:
    for pulse in pulses:
        for camera, frames in gop.boxes.items():
            for number, left, top, right, bottom in frames[pulse - gop.first]:
                box = f"{left:.2f},{top:.2f},{right - left:.2f},{bottom - top:.2f}"
                yield f"{pulse + 1},{time_of(pulse)},{camera},{number},{box},{gop.run}\n"


def _choices(gop: RecordedChoices, pulses: range, time_of: Callable[[int], str]) -> Iterator[str]:
    for pulse in pulses:
        for number, camera in sorted(gop.choices.items()):
            yield f"{pulse + 1},{time_of(pulse)},{number},{camera},{gop.run}\n"
