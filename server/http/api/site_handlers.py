"""``/api/site``, ``objects``, ``cameras``, ``flags`` and ``events``: as far as a token's scope allows."""

from __future__ import annotations

from aiohttp import web

from server.http.access.authorization import ACCESS
from server.http.api.events import EVENTS
from server.http.api.responses import cameras_info, objects_info, site_info
from server.http.api.schema import FlagList
from server.http.api.scope_filter import filter_cameras, filter_flag, filter_objects, filter_site
from server.http.app_keys import SERVICE
from server.http.json_responses import json_response
from server.http.streams.sending import send_viewer
from server.http.viewers.viewer_limits import event_slot, refuse_event_listener

routes = web.RouteTableDef()


@routes.get("/api/site")
async def get_site(request: web.Request) -> web.Response:
    """Describe the site."""
    scope = request.app[ACCESS].grant(request).scope
    return json_response(filter_site(site_info(request.app[SERVICE]), scope))


@routes.get("/api/objects")
async def get_objects(request: web.Request) -> web.Response:
    """List all known people."""
    service, scope = request.app[SERVICE], request.app[ACCESS].grant(request).scope
    return json_response(filter_objects(objects_info(service), scope, service.people.current_number))


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
    events, scope = request.app[EVENTS], request.app[ACCESS].grant(request).scope
    refused = refuse_event_listener(request)
    if refused is not None:
        return refused
    with event_slot(request):
        subscriber = events.join(scope)
        try:
            return await send_viewer(request, subscriber, b"", {"Content-Type": "text/event-stream"})
        finally:
            events.leave(scope, subscriber)
