"""Video streams over HTTP: the best view of a person, and single cameras."""

from __future__ import annotations

from aiohttp import web

from server.http.access.authorization import blur_of, is_scoped_to_person
from server.http.app_keys import SERVICE
from server.http.json_responses import unavailable
from server.http.streams.containers import MP4, TS, WEBM, Container
from server.http.streams.jpeg import stream_rendered_mp4, wants_boxes
from server.http.streams.request_validation import refuse_live_if_scoped, requested_delay, wants_h264
from server.http.streams.sending import send_stream
from server.http.streams.time_range import is_time_shifted
from server.http.streams.time_shift import time_shifted_best, time_shifted_camera
from server.http.viewers.hls_sessions import HLS_SESSIONS
from server.http.viewers.viewer_limits import (
    evict_or_refuse_viewer,
    fixed_view_slot_name,
    hls_camera_slot_name,
    live_camera_slot_name,
    person_slot_name,
    viewer_slot,
)
from server.service.facade.streams import Broadcaster, DelayMode

routes = web.RouteTableDef()


@routes.get("/objects/{object:[0-9]{1,9}}/best.mp4")
async def get_best(request: web.Request) -> web.StreamResponse:
    """Stream the best view of a person as fragmented MP4, without a break at cuts."""
    is_drawn = blur_of(request) is not None or (wants_boxes(request) and not is_time_shifted(request))
    if is_drawn or wants_h264(request):
        return await stream_rendered_mp4(request)
    return await _best(request, MP4)


@routes.get("/objects/{object:[0-9]{1,9}}/best.ts")
async def get_best_ts(request: web.Request) -> web.StreamResponse:
    """Stream the best view of a person as an MPEG transport stream, without a break at cuts."""
    return await _best(request, TS)


@routes.get("/objects/{object:[0-9]{1,9}}/best.webm")
async def get_best_webm(request: web.Request) -> web.StreamResponse:
    """Stream the best view of a person as WebM, if the site's codec is VP8."""
    return await _best(request, WEBM)


@routes.get("/cameras/{camera}/live.mp4")
async def get_live(request: web.Request) -> web.StreamResponse:
    """Stream one camera as fragmented MP4."""
    if wants_h264(request):
        return await stream_rendered_mp4(request)
    return await _live(request, MP4)


@routes.get("/cameras/{camera}/live.ts")
async def get_live_ts(request: web.Request) -> web.StreamResponse:
    """Stream one camera as an MPEG transport stream."""
    return await _live(request, TS)


@routes.get("/cameras/{camera}/live.webm")
async def get_live_webm(request: web.Request) -> web.StreamResponse:
    """Stream one camera as WebM, if the site's codec is VP8."""
    return await _live(request, WEBM)


async def _best(request: web.Request, container: Container) -> web.StreamResponse:
    if is_time_shifted(request):
        return await time_shifted_best(request, container)
    service, number = request.app[SERVICE], int(request.match_info["object"])
    streams, scoped, delay = service.streams, is_scoped_to_person(request), requested_delay(request)
    if (refused := refuse_live_if_scoped(request)) is not None:
        return refused
    person = service.people.current_number(number)
    channel = streams.of_person(person, scoped_to_person=scoped, delay=delay)
    if channel is None:
        raise service.people.unknown(number)
    fixed, preferred = request.query.get("camera"), request.query.get("prefer")
    for camera in (fixed, preferred):
        if camera is not None:
            service.cameras.require(camera)
    slot_name, other_viewers = (
        person_slot_name(person),
        streams.connected_viewers_of_person(person) - channel.viewers,
    )
    hls_name: str | None = slot_name
    if fixed is not None:
        channel = streams.of_camera(fixed) if delay is DelayMode.LIVE else streams.of_camera_decided(fixed)
        slot_name, hls_name, other_viewers = fixed_view_slot_name(fixed), hls_camera_slot_name(fixed), 0
    elif preferred is not None:
        channel = streams.of_person_preferring(person, preferred, scoped_to_person=scoped)
        slot_name, hls_name, other_viewers = f"object {person} preferring {preferred}", None, 0
    return await _send(request, channel, slot_name, hls_name, container, other_viewers)


async def _live(request: web.Request, container: Container) -> web.StreamResponse:
    if is_time_shifted(request):
        return await time_shifted_camera(request, container)
    service, camera = request.app[SERVICE], request.match_info["camera"]
    service.cameras.require(camera)
    channel = service.streams.of_camera(camera)
    return await _send(
        request, channel, live_camera_slot_name(camera), hls_camera_slot_name(camera), container
    )


async def _send(
    request: web.Request,
    channel: Broadcaster,
    slot_name: str,
    hls_name: str | None,
    container: Container,
    other_viewers: int = 0,
) -> web.StreamResponse:
    """Send a channel if a viewer slot is free.

    ``slot_name`` and ``hls_name`` are the slot names of the stream's viewers and HLS players;
    ``other_viewers`` is the number of viewers of the same person over other channels.
    """
    head = container.head(request.app[SERVICE])
    if head is None:
        return unavailable("no camera has delivered a picture yet")
    players = 0 if hls_name is None else request.app[HLS_SESSIONS].of(hls_name)
    viewers = channel.viewers + other_viewers + players
    refused = evict_or_refuse_viewer(request, viewers, (slot_name, hls_name or slot_name))
    if refused is not None:
        return refused
    headers = {"Content-Type": container.content_type}
    with viewer_slot(request, slot_name):
        return await send_stream(request, channel, head, headers, container.packed)
