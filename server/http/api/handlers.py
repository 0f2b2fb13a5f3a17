"""The API: why each view was selected, thumbnails, and health checks."""

from __future__ import annotations

from aiohttp import web

from server.http.app_keys import SERVICE
from server.http.json_responses import error_response, json_response
from server.service.facade.recordings import TimeReferenceError

routes = web.RouteTableDef()


@routes.get("/api/objects/{object:[0-9]{1,9}}/choice")
async def get_choice(request: web.Request) -> web.Response:
    """Return which camera shows this person now, or did within the last minute, since when, and why."""
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
        return error_response(404, f"there is no picture of object {number}")
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
    """Return whether the best view can be served now (pulses, frames, decisions), or the reason why not."""
    service = request.app[SERVICE]
    readiness = service.operations.readiness()
    if readiness.reasons:
        return web.Response(text=f"{'; '.join(readiness.reasons)}\n", status=503)
    error = service.recordings.status.error
    recording = f"; nothing is recorded: {error}" if error else ""
    return web.Response(text=f"{readiness.live_cameras} of {readiness.cameras} cameras{recording}\n")
