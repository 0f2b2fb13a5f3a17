"""The streams over HTTP: the best view of a person, and a camera as it is."""

from __future__ import annotations

from aiohttp import web

from server.http.access.access_control import sees_one_person
from server.http.api.handlers import no_camera, no_object, not_now
from server.http.app_keys import READERS, SERVICE
from server.http.connections.viewer_limits import no_place, watching
from server.http.hls.sessions import of_camera, of_decided, of_live, of_person
from server.http.streams.jpeg import best_with_boxes, wants_boxes
from server.http.streams.sending import send_stream
from server.http.streams.stream_forms import MP4, TS, WEBM, Form
from server.http.streams.time_shift import asks_for_the_past, best_of_the_past, camera_of_the_past
from server.service.streaming.broadcaster import Broadcaster

routes = web.RouteTableDef()


@routes.get("/objects/{object:[0-9]{1,9}}/best.mp4")
async def get_best(request: web.Request) -> web.StreamResponse:
    """Stream the best view of a person as fragmented MP4; it goes on across every cut."""
    if wants_boxes(request) and not asks_for_the_past(request):
        return await best_with_boxes(request)
    return await _best(request, MP4)


@routes.get("/objects/{object:[0-9]{1,9}}/best.ts")
async def get_best_ts(request: web.Request) -> web.StreamResponse:
    """Stream the best view of a person as an MPEG transport stream, likewise."""
    return await _best(request, TS)


@routes.get("/objects/{object:[0-9]{1,9}}/best.webm")
async def get_best_webm(request: web.Request) -> web.StreamResponse:
    """Stream the best view of a person as WebM, where the site's codec is VP8; across every cut."""
    return await _best(request, WEBM)


@routes.get("/cameras/{camera}/live.mp4")
async def get_live(request: web.Request) -> web.StreamResponse:
    """Stream one camera as fragmented MP4."""
    return await _live(request, MP4)


@routes.get("/cameras/{camera}/live.ts")
async def get_live_ts(request: web.Request) -> web.StreamResponse:
    """Stream one camera as an MPEG transport stream."""
    return await _live(request, TS)


@routes.get("/cameras/{camera}/live.webm")
async def get_live_webm(request: web.Request) -> web.StreamResponse:
    """Stream one camera as WebM, likewise."""
    return await _live(request, WEBM)


async def _best(request: web.Request, form: Form) -> web.StreamResponse:
    if asks_for_the_past(request):
        return await best_of_the_past(request, form)
    service = request.app[SERVICE]
    number = int(request.match_info["object"])
    person = service.board.resolve(number)
    scoped, splicer = sees_one_person(request), service.splicer
    channel = (splicer.scoped_persons if scoped else splicer.persons).get(person)
    if channel is None:
        return no_object(service, number)
    held, preferred = request.query.get("camera"), request.query.get("prefer")
    for camera in (held, preferred):
        if camera is not None and camera not in service.frame_buffers:
            return no_camera(service, camera)
    by_channel, beside = of_person(person), splicer.viewers_of(person) - channel.viewers
    fetched: str | None = by_channel
    if held is not None:
        channel = splicer.decided_cameras[held]
        by_channel, fetched, beside = of_decided(held), of_camera(held), 0
    elif preferred is not None:
        preferring = splicer.preferred_scoped if scoped else splicer.preferred
        channel = preferring.broadcaster(person, preferred)
        by_channel, fetched, beside = f"object {person} preferring {preferred}", None, 0
    return await _send(request, channel, by_channel, fetched, form, beside)


async def _live(request: web.Request, form: Form) -> web.StreamResponse:
    if asks_for_the_past(request):
        return await camera_of_the_past(request, form)
    service = request.app[SERVICE]
    camera = request.match_info["camera"]
    channel = service.splicer.cameras.get(camera)
    if channel is None:
        return no_camera(service, camera)
    return await _send(request, channel, of_live(camera), of_camera(camera), form)


async def _send(
    request: web.Request, channel: Broadcaster, stream: str, fetched: str | None, form: Form, beside: int = 0
) -> web.StreamResponse:
    """Send a channel, whose viewers hold places by one name, and who fetches the same (HLS) by another.

    ``beside`` is how many watch the same by another channel.
    """
    head = form.head(request.app[SERVICE])
    if head is None:
        return not_now("no camera has delivered a picture yet")
    readers = 0 if fetched is None else request.app[READERS].of(fetched)
    full = no_place(request, channel.viewers + beside + readers, (stream, fetched or stream))
    if full is not None:
        return full
    with watching(request, stream):
        return await send_stream(request, channel, head, {"Content-Type": form.content_type}, form.packed)
