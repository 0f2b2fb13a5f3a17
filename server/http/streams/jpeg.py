"""Pictures over HTTP: multipart JPEG, single JPEG, and the best view with its boxes burnt in."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable
from functools import wraps

from aiohttp import web

from server.http.access.access_control import sees_one_person
from server.http.api.handlers import no_camera, no_object, not_now, problem
from server.http.app_keys import PICTURES, SERVICE
from server.http.connections.viewer_limits import no_place, watching
from server.http.streams.sending import send_stream, send_viewer
from server.http.streams.stream_forms import MP4
from server.media.rendering_messages import Still
from server.service.rendering.mjpeg_streams import (
    CONTENT_TYPE,
    FIRST_BOUNDARY,
    PULSE_HEADER,
    MjpegVariant,
    multipart_part,
)
from server.service.rendering.render_pool import CameraView, PersonView, RenderPoolFullError, Subject
from server.service.rendering.rendered_stream import PictureTimeoutError

routes = web.RouteTableDef()

_EXPOSED = {"Access-Control-Expose-Headers": PULSE_HEADER}

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class _RefusedError(Exception):
    """There is another answer."""

    def __init__(self, answer: web.Response) -> None:
        super().__init__(answer.text)
        self.answer = answer


def _or_refused(handler: Handler) -> Handler:
    @wraps(handler)
    async def run(request: web.Request) -> web.StreamResponse:
        try:
            return await handler(request)
        except _RefusedError as refused:
            return refused.answer
        except RenderPoolFullError:
            return not_now("as many pictures as this server makes (http.pictures_max) are being made")
        except PictureTimeoutError:
            return not_now("no picture came in time")

    return run


@routes.get("/objects/{object:[0-9]{1,9}}/best.mjpeg")
@routes.get("/cameras/{camera}/live.mjpeg")
@_or_refused
async def get_mjpeg(request: web.Request) -> web.StreamResponse:
    """Stream as multipart JPEG, for whatever shows pictures but no video."""
    return await _mjpeg(request, _subject(request))


@routes.get("/objects/{object:[0-9]{1,9}}/best.jpg")
@routes.get("/cameras/{camera}/live.jpg")
@_or_refused
async def get_still(request: web.Request) -> web.StreamResponse:
    """Give the newest picture of a stream."""
    return await _still(request, _subject(request))


def wants_boxes(request: web.Request) -> bool:
    """Tell whether boxes are asked for."""
    return request.query.get("overlay") == "1"


@_or_refused
async def best_with_boxes(request: web.Request) -> web.StreamResponse:
    """Stream the best view of a person as fragmented MP4 with the boxes burnt in."""
    headers = {"Content-Type": "video/mp4"}
    subject = _person(request)
    _newest(request, subject)
    if request.method == "HEAD":
        return _headers_only(headers)
    _check_place(request, subject)
    with watching(request, _named(subject)), request.app[PICTURES].using(subject) as source:
        film = source.film
        film.wanted += 1
        try:
            head = await source.film_head()
            return await send_stream(request, film.channel, head, headers, MP4.packed)
        finally:
            film.wanted -= 1


async def _mjpeg(request: web.Request, subject: Subject) -> web.StreamResponse:
    headers = {"Content-Type": CONTENT_TYPE}
    series = MjpegVariant(_rate(request), wants_boxes(request))
    pulse = _newest(request, subject)
    if request.method == "HEAD":
        return _headers_only(headers)
    _check_place(request, subject)
    with watching(request, _named(subject)), request.app[PICTURES].using(subject) as source:
        first = await source.still(_kind(request), pulse)
        viewer = source.series.join(series)
        try:
            return await send_viewer(request, viewer, FIRST_BOUNDARY + multipart_part(first), headers)
        finally:
            source.series.leave(series, viewer)


async def _still(request: web.Request, subject: Subject) -> web.StreamResponse:
    pulse = _newest(request, subject)
    if request.method == "HEAD":
        return _headers_only({"Content-Type": "image/jpeg", PULSE_HEADER: str(pulse)})
    with request.app[PICTURES].using(subject) as source:
        picture = await source.still(_kind(request), pulse)
    answer = _headers_only({"Content-Type": "image/jpeg", PULSE_HEADER: str(picture.pulse)})
    answer.body = picture.data
    return answer


def _headers_only(headers: dict[str, str]) -> web.Response:
    always = {"Cache-Control": "no-store", "Access-Control-Allow-Origin": "*", **_EXPOSED}
    return web.Response(headers={**always, **headers})


def _subject(request: web.Request) -> Subject:
    return _camera(request) if "camera" in request.match_info else _person(request)


def _person(request: web.Request) -> Subject:
    service, number = request.app[SERVICE], int(request.match_info["object"])
    known, scoped = service.board.resolve(number), sees_one_person(request)
    if known not in (service.splicer.scoped_persons if scoped else service.splicer.persons):
        raise _RefusedError(no_object(service, number))
    return PersonView(known, scoped)


def _camera(request: web.Request) -> Subject:
    service, camera = request.app[SERVICE], request.match_info["camera"]
    if camera not in service.frame_buffers:
        raise _RefusedError(no_camera(service, camera))
    return CameraView(camera, decided=wants_boxes(request))


def _newest(request: web.Request, subject: Subject) -> int:
    try:
        pulse = request.app[PICTURES].newest(subject)
    except KeyError:
        pulse = None
    if pulse is None:
        raise _RefusedError(not_now(f"there is no picture of {subject} now"))
    return pulse


def _kind(request: web.Request) -> Still:
    return "boxed" if wants_boxes(request) else "plain"


def _rate(request: web.Request) -> float:
    """Give the pictures a second that are asked for, at most the site's."""
    most, asked = request.app[SERVICE].config.site.fps, request.query.get("fps")
    if asked is None:
        return most
    try:
        rate = float(asked)
    except ValueError:
        rate = math.nan
    if not 0 < rate < math.inf:
        raise _RefusedError(problem(400, f"fps={asked}: must be a number above 0, such as fps=5"))
    return min(rate, most)


def _named(subject: Subject) -> str:
    return f"pictures of {subject}"


def _check_place(request: web.Request, subject: Subject) -> None:
    source = request.app[PICTURES].sources.get(subject)
    full = no_place(request, 0 if source is None else source.viewers, (_named(subject),))
    if full is not None:
        raise _RefusedError(full)
