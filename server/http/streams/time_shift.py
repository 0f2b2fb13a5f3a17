"""Time shift: streams that begin in the past and continue live when they have caught up."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import aclosing

from aiohttp import web

from server.http.access.authorization import is_scoped_to_person
from server.http.app_keys import SERVICE
from server.http.json_responses import error_response, unavailable
from server.http.streams.containers import Container
from server.http.streams.sending import send_bytes
from server.http.streams.time_range import forget_missing_or_refuse, parse_time_range, refuse_unrecorded
from server.http.viewers.viewer_limits import (
    evict_or_refuse_viewer,
    live_camera_slot_name,
    person_slot_name,
    viewer_slot,
)
from server.service.facade.recordings import RecordedStream, TimeReferenceError
from server.service.facade.streams import Broadcaster


async def time_shifted_best(request: web.Request, container: Container) -> web.StreamResponse:
    """Stream the best view of a person from a past moment on."""
    service, number = request.app[SERVICE], int(request.match_info["object"])
    scoped = is_scoped_to_person(request)
    recorded = service.recordings.of_person(number, scoped_to_person=scoped)

    def live() -> Broadcaster | None:
        return service.streams.of_person(service.people.current_number(number), scoped_to_person=scoped)

    if live() is None:
        if (unreadable := await forget_missing_or_refuse(recorded, 0)) is not None:
            return unreadable
        if recorded.available_from(0) is None:
            raise service.people.unknown(number)

    def name() -> str:
        return person_slot_name(service.people.current_number(number))

    return await _stream(request, container, recorded, live, name)


async def time_shifted_camera(request: web.Request, container: Container) -> web.StreamResponse:
    """Stream one camera from a past moment on."""
    service, camera = request.app[SERVICE], request.match_info["camera"]
    recorded = service.recordings.of_camera(camera)

    def live() -> Broadcaster | None:
        return service.streams.of_camera(camera)

    return await _stream(request, container, recorded, live, lambda: live_camera_slot_name(camera))


async def _stream(
    request: web.Request,
    container: Container,
    recorded: RecordedStream,
    live: Callable[[], Broadcaster | None],
    live_name: Callable[[], str],
) -> web.StreamResponse:
    """Stream from a past moment on, then continue with ``live``, whose slots are named ``live_name``."""
    service = request.app[SERVICE]
    recordings, head = service.recordings, container.head(service)
    if head is None:
        return unavailable("no camera has delivered a picture yet")
    if request.query.get("overlay", "0") != "0":
        return error_response(400, "overlay: not available in the past; /api/past has the boxes")
    try:
        playback = parse_time_range(request, service, recorded.end)
    except TimeReferenceError as error:
        return error_response(400, str(error))
    missing = await refuse_unrecorded(recorded, playback)
    if missing is not None:
        return missing
    refused = evict_or_refuse_viewer(request)
    if refused is not None:
        return refused
    is_past = True

    def join_live() -> Broadcaster | None:
        nonlocal is_past
        if is_past:
            recordings.viewer_left()  # the live channel counts this viewer from here on
        is_past = False
        slot.stream = live_name()
        return live()

    with viewer_slot(request, "past") as slot:
        recordings.viewer_joined()
        try:
            async with aclosing(recorded.play(playback, join_live)) as chunks:
                data = (container.packed(chunk) async for chunk in chunks)
                return await send_bytes(request, data, head, {"Content-Type": container.content_type})
        finally:
            if is_past:
                recordings.viewer_left()
