"""HTTP Live Streaming (RFC 8216): the streams in segments of fragmented MP4, for players that fetch."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import wraps

from aiohttp import web

from server.http.access.access_control import ACCESS, sees_one_person
from server.http.api.handlers import no_camera, no_object, not_now, problem
from server.http.app_keys import READERS, SERVICE
from server.http.connections.viewer_limits import no_place
from server.http.hls.live_playlist import coming_part, newest
from server.http.hls.sessions import Reader, of_camera, of_live, of_person
from server.http.hls.time_shift_playlist import Stream, playlist_of_the_past, segment_of_the_past
from server.http.hls.token_query import with_token
from server.http.streams.stream_forms import mp4_head
from server.http.streams.time_shift import asks_for_the_past, object_past
from server.service.time_shift.playback import CameraPlayback

routes = web.RouteTableDef()

_ANYBODY = {"Access-Control-Allow-Origin": "*"}
_OBJECT = "/objects/{object:[0-9]{1,9}}/hls"
_CAMERA = "/cameras/{camera}/hls"
_NUMBER = "{segment:[0-9]{1,12}}"
_AGENT = 200
"""Letters of a player's name for itself that are looked at."""


_Handler = Callable[[web.Request], Awaitable[web.Response]]
_OfStream = Callable[[web.Request, Stream], Awaitable[web.Response]]


def _counted(awaits: str | None = None) -> Callable[[_OfStream], _Handler]:
    """Let whoever asks be a viewer, if there is place; ``awaits``: what they may have to wait for."""

    def counted(handler: _OfStream) -> _Handler:
        @wraps(handler)
        async def run(request: web.Request) -> web.Response:
            stream = _stream(request)
            if stream is None:
                return _nobody(request)
            if request.method == "HEAD":
                return await handler(request, stream)
            readers, reader = request.app[READERS], _reader(request)
            if readers.is_one_more(reader, awaits):
                by_channel, connected = _connected(request)
                counted = connected + readers.of(reader.stream)
                full = no_place(request, counted, (reader.stream, by_channel))
                if full is not None:
                    return full
            with readers.asking(reader, awaits):
                return await handler(request, stream)

        return run

    return counted


@routes.get(_OBJECT + "/index.m3u8")
@routes.get(_CAMERA + "/index.m3u8")
@_counted("playlist")
async def get_playlist(request: web.Request, stream: Stream) -> web.Response:
    """List the newest segments of a stream (HLS), or from a moment on."""
    if asks_for_the_past(request):
        return with_token(request, await playlist_of_the_past(request, stream))
    if stream.reel is None:
        return _nobody(request)
    return with_token(request, await newest(request, stream.reel, request.app[SERVICE].pulse0))


@routes.get(_OBJECT + "/init.mp4")
@routes.get(_CAMERA + "/init.mp4")
@_counted()
async def get_init(request: web.Request, stream: Stream) -> web.Response:
    """Give what a player needs before the first segment of a stream (HLS)."""
    del stream
    head = mp4_head(request.app[SERVICE])
    return not_now("no camera has delivered a picture yet") if head is None else _media(request, head)


@routes.get(_OBJECT + f"/{_NUMBER}.m4s")
@routes.get(_CAMERA + f"/{_NUMBER}.m4s")
@_counted()
async def get_segment(request: web.Request, stream: Stream) -> web.Response:
    """Give a segment of a stream (HLS), new or past."""
    number = int(request.match_info["segment"])
    segment = None if stream.reel is None else stream.reel.get(number)
    if segment is None:
        segment = await segment_of_the_past(request, stream, number)
    if segment is None:
        return problem(404, f"there is no segment {number} here, or not any more")
    return _media(request, segment.data)


@routes.get(_OBJECT + f"/{_NUMBER}.{{part:[0-9]{{1,6}}}}.m4s")
@routes.get(_CAMERA + f"/{_NUMBER}.{{part:[0-9]{{1,6}}}}.m4s")
@_counted("part")
async def get_part(request: web.Request, stream: Stream) -> web.Response:
    """Give a part of a segment of a stream (HLS); one that is yet to come is waited for."""
    if stream.reel is None:
        return _nobody(request)
    number, index = int(request.match_info["segment"]), int(request.match_info["part"])
    part = await coming_part(stream.reel, number, index)
    if part is None:
        return problem(404, f"there is no part {number}.{index} here, or not any more")
    return _media(request, part.data)


def _media(request: web.Request, data: bytes) -> web.Response:
    """Give bytes that never change. A site that starts anew counts anew: they are not kept for long."""
    plan = request.app[SERVICE].splicer.layout
    kept_s = int(2 * plan.playlist_length * plan.segment_frames / plan.fps)
    headers = {**_ANYBODY, "Cache-Control": f"public, max-age={kept_s}, immutable"}
    return web.Response(body=data, content_type="video/mp4", headers=headers)


def _stream(request: web.Request) -> Stream | None:
    service = request.app[SERVICE]
    if "camera" in request.match_info:
        camera = request.match_info["camera"]
        reel = service.splicer.segmenter_of_camera(camera)
        return (
            None if reel is None else Stream(f"camera {camera}", reel, CameraPlayback(service.past, camera))
        )
    number = int(request.match_info["object"])
    reel = service.splicer.segmenter_of_person(service.board.resolve(number), scoped=sees_one_person(request))
    stream = Stream(f"object {number}", reel, object_past(request, number))
    return stream if stream.exists else None


def _reader(request: web.Request) -> Reader:
    """Tell players apart by address and by what they call themselves, as far as that goes."""
    service, names = request.app[SERVICE], request.match_info
    if "camera" in names:
        stream = of_camera(names["camera"])
    else:
        stream = of_person(service.board.resolve(int(names["object"])))
    holder = request.app[ACCESS].share_holder(request)
    return Reader(stream, holder, request.remote or "", request.headers.get("User-Agent", "")[:_AGENT])


def _connected(request: web.Request) -> tuple[str, int]:
    """Give the same stream's name over connections of their own, and how many are sent it so."""
    service, names = request.app[SERVICE], request.match_info
    if "camera" in names:
        return of_live(names["camera"]), service.splicer.cameras[names["camera"]].viewers
    number = service.board.resolve(int(names["object"]))
    return of_person(number), service.splicer.viewers_of(number)


def _nobody(request: web.Request) -> web.Response:
    if "camera" in request.match_info:
        return no_camera(request.app[SERVICE], request.match_info["camera"])
    return no_object(request.app[SERVICE], int(request.match_info["object"]))
