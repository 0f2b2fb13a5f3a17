"""What is known of the whole site: to each as much of it as they may see."""

from __future__ import annotations

from aiohttp import web

from server.http.access.access_control import ACCESS
from server.http.access.scope_filter import cameras_for, flag_for, objects_for, site_for
from server.http.api.events import Events
from server.http.api.handlers import answer
from server.http.api.responses import cameras_info, objects_info, site_info
from server.http.api.schema import FlagList
from server.http.app_keys import EVENTS, SERVICE
from server.http.connections.viewer_limits import listening, no_ear
from server.http.streams.sending import send_viewer

routes = web.RouteTableDef()


@routes.get("/api/site")
async def get_site(request: web.Request) -> web.Response:
    """Describe the site."""
    return answer(site_for(site_info(request.app[SERVICE]), request.app[ACCESS].grant(request).sees))


@routes.get("/api/objects")
async def get_objects(request: web.Request) -> web.Response:
    """List everybody who is known."""
    service, sees = request.app[SERVICE], request.app[ACCESS].grant(request).sees
    return answer(objects_for(objects_info(service), sees, service.board.resolve))


@routes.get("/api/cameras")
async def get_cameras(request: web.Request) -> web.Response:
    """List the cameras and how they are."""
    return answer(cameras_for(cameras_info(request.app[SERVICE]), request.app[ACCESS].grant(request).sees))


@routes.get("/api/flags")
async def get_flags(request: web.Request) -> web.Response:
    """List what an operator is asked to look at, and what they were asked lately."""
    service, sees = request.app[SERVICE], request.app[ACCESS].grant(request).sees
    flags = service.assist.flags
    told = (flag_for(flag, sees, service.board.resolve) for flag in [*flags.open, *flags.ended])
    return answer(FlagList([flag for flag in told if flag is not None]))


@routes.get("/api/events")
async def get_events(request: web.Request) -> web.StreamResponse:
    """Tell what happens as it happens: server-sent events."""
    events: Events = request.app[EVENTS]
    sees = request.app[ACCESS].grant(request).sees
    full = no_ear(request)
    if full is not None:
        return full
    with listening(request):
        viewer = events.join(sees)
        try:
            return await send_viewer(request, viewer, b"", {"Content-Type": "text/event-stream"})
        finally:
            events.leave(sees, viewer)
