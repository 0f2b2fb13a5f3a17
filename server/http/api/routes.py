"""Routes of the API: the site, people, cameras, flags, events, view selection, thumbnails, health checks."""

from __future__ import annotations

from aiohttp import web

from server.http.access.authorization import ACCESS
from server.http.api.events import EVENTS, Audience
from server.http.api.responses import cameras_info, delays_info, objects_info, site_info
from server.http.api.schema import FlagList
from server.http.api.scope_filter import filter_cameras, filter_flag, filter_objects, filter_site
from server.http.app_keys import SERVICE
from server.http.json_responses import error_response, json_response
from server.http.streams.request_validation import (
    invalid_event_query,
    refuse_live_if_scoped,
    requested_delay,
)
from server.http.streams.sending import send_viewer
from server.http.viewers.viewer_limits import event_slot, evict_or_refuse_listener
from server.service.facade.recordings import TimeReferenceError

routes = web.RouteTableDef()


@routes.get("/api/site")
async def get_site(request: web.Request) -> web.Response:
    """Describe the site."""
    scope = request.app[ACCESS].grant(request).scope
    return json_response(filter_site(site_info(request.app[SERVICE]), scope))


@routes.get("/api/delays")
async def get_delays(request: web.Request) -> web.Response:
    """List the delays that viewers may choose, each with its measured delay and regret."""
    return json_response(delays_info(request.app[SERVICE], request.app[ACCESS].grant(request).scope))


@routes.get("/api/objects")
async def get_objects(request: web.Request) -> web.Response:
    """List all known people."""
    service, access = request.app[SERVICE], request.app[ACCESS]
    objects = objects_info(service, access.token_of(request))
    return json_response(filter_objects(objects, access.grant(request).scope, service.people.current_number))


@routes.get("/api/cameras")
async def get_cameras(request: web.Request) -> web.Response:
    """List the cameras and their states."""
    scope = request.app[ACCESS].grant(request).scope
    return json_response(filter_cameras(cameras_info(request.app[SERVICE]), scope))


@routes.get("/api/flags")
async def get_flags(request: web.Request) -> web.Response:
    """List open flags and recently ended ones."""
    service, scope = request.app[SERVICE], request.app[ACCESS].grant(request).scope
    flags = [*service.assist.open_flags, *service.assist.ended_flags]
    visible = (filter_flag(flag, scope, service.people.current_number) for flag in flags)
    return json_response(FlagList([flag for flag in visible if flag is not None]))


@routes.get("/api/events")
async def get_events(request: web.Request) -> web.StreamResponse:
    """Stream events as server-sent events."""
    events, access = request.app[EVENTS], request.app[ACCESS]
    error = invalid_event_query(request)
    if error is not None:
        return error_response(400, error)
    refused = refuse_live_if_scoped(request) or evict_or_refuse_listener(request)
    if refused is not None:
        return refused
    token = request.app[SERVICE].sites.audience(access.token_of(request))
    audience = Audience(access.grant(request).scope, requested_delay(request), token)
    with event_slot(request):
        subscriber = events.join(audience)
        try:
            return await send_viewer(request, subscriber, b"", {"Content-Type": "text/event-stream"})
        finally:
            events.leave(audience, subscriber)


@routes.get("/api/rules")
async def get_rules(request: web.Request) -> web.Response:
    """List zones and who is in them, rules, and the newest events."""
    return json_response(request.app[SERVICE].rules.rules())


@routes.get("/api/events/{event:[0-9a-f-]{1,64}}/picture.jpg")
async def get_event_picture(request: web.Request) -> web.Response:
    """Return a small picture of the first of the people that an event is about."""
    jpeg = request.app[SERVICE].rules.picture_of(request.match_info["event"])
    if jpeg is None:
        return error_response(404, "there is no such event any more, or no picture of it")
    return web.Response(body=jpeg, content_type="image/jpeg", headers={"Cache-Control": "private"})


@routes.get("/api/objects/{object:[0-9]{1,9}}/choice")
async def get_choice(request: web.Request) -> web.Response:
    """Return which camera shows this person now, or did within the last minute, since when and why."""
    service, number = request.app[SERVICE], int(request.match_info["object"])
    if "at" not in request.query:
        selection = service.people.view_selection_of(number)
        if selection is None:
            raise service.people.unknown(number)
        return json_response(selection)
    try:
        pulse = service.recordings.pulse_at(request.query["at"], now=service.decided_end - 1)
    except TimeReferenceError as error:
        return error_response(400, f"at: {error}")
    selection = service.people.view_selection_of(number, pulse)
    if selection is None:
        return error_response(404, f"no reasons are stored for object {number} at pulse {pulse}")
    return json_response(selection)


@routes.get("/objects/{object:[0-9]{1,9}}/thumb.jpg")
async def get_thumbnail(request: web.Request) -> web.Response:
    """Return a thumbnail of this person."""
    number = int(request.match_info["object"])
    thumbnail = request.app[SERVICE].people.thumbnail_of(number)
    if thumbnail is None:
        return error_response(404, f"there is no thumbnail of object {number}")
    return web.Response(
        body=thumbnail.jpeg, content_type="image/jpeg", headers={"Cache-Control": "private, max-age=60"}
    )


@routes.get("/healthz")
async def get_health(request: web.Request) -> web.Response:
    """Return 200 while the process answers."""
    del request
    return web.Response(text="ok\n")


@routes.get("/readyz")
async def get_ready(request: web.Request) -> web.Response:
    """Return 200 if the best view can be served now (pulses, frames, decisions), or 503 with the reason."""
    service = request.app[SERVICE]
    readiness = service.operations.readiness()
    if readiness.reasons:
        return web.Response(text=f"{'; '.join(readiness.reasons)}\n", status=503)
    error = service.recordings.status.error
    recording = f"; nothing is recorded: {error}" if error else ""
    return web.Response(text=f"{readiness.live_cameras} of {readiness.cameras} cameras{recording}\n")
