"""Rendered streams over HTTP: MJPEG, single JPEGs, and MP4 with boxes, with people pixelated, or as H.264."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable
from dataclasses import replace
from functools import wraps

from aiohttp import web

from server.http.access.authorization import blur_of, is_scoped_to_person
from server.http.app_keys import SERVICE
from server.http.json_responses import error_response, unavailable
from server.http.streams.containers import MP4
from server.http.streams.request_validation import refuse_live_if_scoped, requested_delay
from server.http.streams.sending import send_stream, send_viewer
from server.http.viewers.viewer_limits import evict_or_refuse_viewer, rendered_stream, viewer_slot
from server.service.facade.rendering import (
    CONTENT_TYPE,
    FIRST_BOUNDARY,
    PULSE_HEADER,
    CameraView,
    MjpegVariant,
    PersonView,
    PictureKind,
    PictureTimeoutError,
    RenderPoolFullError,
    Subject,
    part_and_boundary,
)
from server.service.facade.streams import DelayMode

routes = web.RouteTableDef()

_EXPOSED = {"Access-Control-Expose-Headers": PULSE_HEADER}

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class _ResponseError(Exception):
    """Ends a handler with another response."""

    def __init__(self, response: web.Response) -> None:
        super().__init__(response.text)
        self.response = response


def _rendering(handler: Handler) -> Handler:
    """Wrap a handler: answer 503 if rendering is not possible."""

    @wraps(handler)
    async def run(request: web.Request) -> web.StreamResponse:
        try:
            return await handler(request)
        except _ResponseError as error:
            return error.response
        except RenderPoolFullError:
            return unavailable("the server renders as many streams as allowed (http.pictures_max)")
        except PictureTimeoutError:
            return unavailable("no picture was rendered in time")

    return run


@routes.get("/objects/{object:[0-9]{1,9}}/best.mjpeg")
@routes.get("/cameras/{camera}/live.mjpeg")
@_rendering
async def get_mjpeg(request: web.Request) -> web.StreamResponse:
    """Stream as multipart JPEG, for clients that show pictures but no video."""
    return await _mjpeg(request, _subject(request))


@routes.get("/objects/{object:[0-9]{1,9}}/best.jpg")
@routes.get("/cameras/{camera}/live.jpg")
@_rendering
async def get_still(request: web.Request) -> web.StreamResponse:
    """Return the newest picture of a stream as JPEG."""
    return await _still(request, _subject(request))


def wants_boxes(request: web.Request) -> bool:
    """Return whether the request is for pictures with boxes."""
    return request.query.get("overlay") == "1"


@_rendering
async def stream_rendered_mp4(request: web.Request) -> web.StreamResponse:
    """Stream as fragmented MP4 of H.264: with boxes, with people pixelated, or only encoded anew."""
    headers = {"Content-Type": "video/mp4"}
    subject = _video_subject(request)
    _newest(request, subject)
    if request.method == "HEAD":
        return _headers_only(headers)
    _check_slot(request, subject)
    with viewer_slot(request, _slot_name(subject)), rendered_stream(request, subject) as source:
        video = source.video
        video.users += 1
        try:
            head = await source.video_head()
            return await send_stream(request, video.broadcaster, head, headers, MP4.packed)
        finally:
            video.users -= 1


async def _mjpeg(request: web.Request, subject: Subject) -> web.StreamResponse:
    headers = {"Content-Type": CONTENT_TYPE}
    variant = MjpegVariant(_rate(request), wants_boxes(request))
    pulse = _newest(request, subject)
    if request.method == "HEAD":
        return _headers_only(headers)
    _check_slot(request, subject)
    with viewer_slot(request, _slot_name(subject)), rendered_stream(request, subject) as source:
        first = await source.still(_kind(request), pulse)
        viewer = source.mjpeg.subscribe(variant)
        try:
            return await send_viewer(request, viewer, FIRST_BOUNDARY + part_and_boundary(first), headers)
        finally:
            source.mjpeg.unsubscribe(variant, viewer)


async def _still(request: web.Request, subject: Subject) -> web.StreamResponse:
    pulse = _newest(request, subject)
    if request.method == "HEAD":
        return _headers_only({"Content-Type": "image/jpeg", PULSE_HEADER: str(pulse)})
    with rendered_stream(request, subject) as source:
        picture = await source.still(_kind(request), pulse)
    response = _headers_only({"Content-Type": "image/jpeg", PULSE_HEADER: str(picture.pulse)})
    response.body = picture.data
    return response


def _headers_only(headers: dict[str, str]) -> web.Response:
    always = {"Cache-Control": "no-store", "Access-Control-Allow-Origin": "*", **_EXPOSED}
    return web.Response(headers={**always, **headers})


def _subject(request: web.Request) -> Subject:
    return _camera(request) if "camera" in request.match_info else _person(request)


def _video_subject(request: web.Request) -> Subject:
    if "camera" in request.match_info:
        return replace(_camera(request), video="plain")
    person = _person(request)
    if wants_boxes(request):
        return replace(person, video="boxed")
    fixed, preferred = request.query.get("camera"), request.query.get("prefer")
    for camera in (fixed, preferred):
        if camera is not None:
            request.app[SERVICE].cameras.require(camera)
    if fixed is not None:
        return CameraView(fixed, decided=person.delay is not DelayMode.LIVE, video="plain")
    return replace(person, video="plain", prefer=preferred)


def _person(request: web.Request) -> PersonView:
    service, number = request.app[SERVICE], int(request.match_info["object"])
    current, scoped = service.people.current_number(number), is_scoped_to_person(request)
    if service.streams.of_person(current, scoped_to_person=scoped) is None:
        raise service.people.unknown(number)
    if (refused := refuse_live_if_scoped(request)) is not None:
        raise _ResponseError(refused)
    blur = blur_of(request)
    return PersonView(current, scoped, requested_delay(request), blur, "boxed" if blur is None else "plain")


def _camera(request: web.Request) -> CameraView:
    camera = request.match_info["camera"]
    request.app[SERVICE].cameras.require(camera)
    blur = blur_of(request)
    return CameraView(camera, decided=wants_boxes(request) or blur is not None, blur=blur)


def _newest(request: web.Request, subject: Subject) -> int:
    try:
        pulse = request.app[SERVICE].rendering.newest(subject)
    except KeyError:
        pulse = None
    if pulse is None:
        raise _ResponseError(unavailable(f"there is no picture of {subject} now"))
    return pulse


def _kind(request: web.Request) -> PictureKind:
    return "boxed" if wants_boxes(request) else "plain"


def _rate(request: web.Request) -> float:
    """Return the requested pictures a second, at most the site's frame rate."""
    most, text = request.app[SERVICE].config.site.fps, request.query.get("fps")
    if text is None:
        return most
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not 0 < rate < math.inf:
        raise _ResponseError(error_response(400, f"fps={text}: must be a number above 0, such as fps=5"))
    return min(rate, most)


def _slot_name(subject: Subject) -> str:
    return f"pictures of {subject}"


def _check_slot(request: web.Request, subject: Subject) -> None:
    source = request.app[SERVICE].rendering.streams.get(subject)
    viewers = 0 if source is None else source.viewers
    refused = evict_or_refuse_viewer(request, viewers, (_slot_name(subject),))
    if refused is not None:
        raise _ResponseError(refused)
