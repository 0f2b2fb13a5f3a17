"""``/api/…/past``: recorded spans of people and cameras, and recorded decisions."""

from __future__ import annotations

import sys

from aiohttp import web

from server.http.access.authorization import ACCESS, is_scoped_to_person
from server.http.api.schema import Past, PastSpan, PastView
from server.http.api.scope_filter import filter_decisions
from server.http.app_keys import SERVICE
from server.http.json_responses import error_response, json_response
from server.http.streams.sending import send_bytes
from server.http.streams.time_range import (
    decisions_in,
    disk_error,
    forget_missing_or_refuse,
    parse_time_range,
)
from server.http.viewers.viewer_limits import event_slot, evict_or_refuse_listener
from server.service.facade.recordings import RecordedStream, TimeReferenceError

routes = web.RouteTableDef()


@routes.get("/api/objects/{object:[0-9]{1,9}}/past")
async def get_person_past(request: web.Request) -> web.Response:
    """Return the time ranges in which a person's best view is recorded, within from= and to=."""
    number = int(request.match_info["object"])
    recorded = request.app[SERVICE].recordings.of_person(
        number, scoped_to_person=is_scoped_to_person(request)
    )
    if (unreadable := await forget_missing_or_refuse(recorded, 0)) is not None:
        return unreadable
    if recorded.available_from(0) is None:
        return error_response(404, f"nothing is recorded of object {number}")
    return await _past(request, recorded)


@routes.get("/api/cameras/{camera}/past")
async def get_camera_past(request: web.Request) -> web.Response:
    """Return the time ranges in which a camera is recorded, within from= and to=."""
    return await _past(request, request.app[SERVICE].recordings.of_camera(request.match_info["camera"]))


@routes.get("/api/past")
async def get_decisions(request: web.Request) -> web.StreamResponse:
    """Stream the recorded decisions, one line per GOP, within from= and to=."""
    service = request.app[SERVICE]
    try:
        playback = parse_time_range(request, service, service.recordings.decided_end)
    except TimeReferenceError as error:
        return error_response(400, str(error))
    scope = request.app[ACCESS].grant(request).scope
    lines = await decisions_in(service, playback)
    if isinstance(lines, web.Response):
        return lines
    refused = evict_or_refuse_listener(request)
    if refused is not None:
        return refused
    visible = filter_decisions(lines, scope, service.people.current_number)
    with event_slot(request):
        return await send_bytes(request, visible, b"", {"Content-Type": "application/x-ndjson"})


async def _past(request: web.Request, recorded: RecordedStream) -> web.Response:
    service = request.app[SERVICE]
    time_of = service.recordings.time_of
    try:
        playback = parse_time_range(request, service, recorded.end, start=0)
    except TimeReferenceError as error:
        return error_response(400, str(error))
    end = sys.maxsize if playback.end is None else playback.end
    try:
        await recorded.forget_missing(playback.start, end)
    except OSError as error:
        return disk_error(error)
    spans = [
        PastSpan(span.first, span.end - span.first, time_of(span.first), time_of(span.end))
        for span in recorded.spans(playback.start, end)
    ]
    views = [
        PastView(view.camera, view.first, view.end - view.first)
        for view in recorded.views(playback.start, end)
    ]
    return json_response(Past(spans, views))
