"""HTTP Live Streaming (RFC 8216): playlists, segments and parts of every stream."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import wraps

from aiohttp import web

from server.http.access.authorization import ACCESS, is_scoped_to_person
from server.http.app_keys import SERVICE
from server.http.hls.live_playlist import live_playlist, wait_for_part
from server.http.hls.playlist import with_query
from server.http.hls.time_shift_playlist import HlsStream, time_shift_playlist, time_shift_segment
from server.http.json_responses import error_response, unavailable
from server.http.streams.request_validation import requested_delay
from server.http.streams.time_range import is_time_shifted
from server.http.viewers.hls_sessions import HLS_SESSIONS, HlsClient
from server.http.viewers.viewer_limits import (
    evict_or_refuse_viewer,
    hls_camera_slot_name,
    live_camera_slot_name,
    person_slot_name,
)
from server.service.facade.errors import RefusedError
from server.service.facade.streams import DelayMode

routes = web.RouteTableDef()

_ANY_ORIGIN = {"Access-Control-Allow-Origin": "*"}
_OBJECT = "/objects/{object:[0-9]{1,9}}/hls"
_CAMERA = "/cameras/{camera}/hls"
_SEGMENT = "{segment:[0-9]{1,12}}"
_AGENT_CHARS = 200
"""Characters of the User-Agent header by which players are distinguished."""


_Handler = Callable[[web.Request], Awaitable[web.Response]]
_StreamHandler = Callable[[web.Request, HlsStream], Awaitable[web.Response]]


def _counted(blocking_kind: str | None = None) -> Callable[[_StreamHandler], _Handler]:
    """Count the player as a viewer, or refuse it; ``blocking_kind`` is as in :class:`HlsSessions`."""

    def counted(handler: _StreamHandler) -> _Handler:
        @wraps(handler)
        async def run(request: web.Request) -> web.Response:
            stream = _stream(request)
            if request.method == "HEAD":
                return await handler(request, stream)
            sessions, player = request.app[HLS_SESSIONS], _client(request)
            if sessions.is_new_viewer(player, blocking_kind):
                slot_name, connected = _connected_viewers(request)
                viewers = connected + sessions.of(player.stream)
                refused = evict_or_refuse_viewer(request, viewers, (player.stream, slot_name))
                if refused is not None:
                    return refused
            with sessions.request(player, blocking_kind):
                return await handler(request, stream)

        return run

    return counted


@routes.get(_OBJECT + "/index.m3u8")
@routes.get(_CAMERA + "/index.m3u8")
@_counted("playlist")
async def get_playlist(request: web.Request, stream: HlsStream) -> web.Response:
    """Return the playlist of a stream (HLS), live or from a moment on."""
    if is_time_shifted(request):
        return with_query(request, await time_shift_playlist(request, stream))
    if stream.live is None:
        raise _unknown(request)
    return with_query(request, await live_playlist(request, stream.live, request.app[SERVICE].pulse0))


@routes.get(_OBJECT + "/init.mp4")
@routes.get(_CAMERA + "/init.mp4")
@_counted()
async def get_init(request: web.Request, stream: HlsStream) -> web.Response:
    """Return the initialization segment of a stream (HLS)."""
    del stream
    head = request.app[SERVICE].streams.init_segment()
    return unavailable("no camera has delivered a picture yet") if head is None else _media(request, head)


@routes.get(_OBJECT + f"/{_SEGMENT}.m4s")
@routes.get(_CAMERA + f"/{_SEGMENT}.m4s")
@_counted()
async def get_segment(request: web.Request, stream: HlsStream) -> web.Response:
    """Return a media segment of a stream (HLS), live or recorded."""
    number = int(request.match_info["segment"])
    segment = None if stream.live is None else stream.live.listed_segment(number)
    if segment is None and not _is_smooth(request):
        segment = await time_shift_segment(request, stream, number)
    if segment is None:
        return error_response(404, f"no segment {number}: expired, or not available yet")
    return _media(request, segment.data)


@routes.get(_OBJECT + f"/{_SEGMENT}.{{part:[0-9]{{1,6}}}}.m4s")
@routes.get(_CAMERA + f"/{_SEGMENT}.{{part:[0-9]{{1,6}}}}.m4s")
@_counted("part")
async def get_part(request: web.Request, stream: HlsStream) -> web.Response:
    """Return a part of a segment of a stream (HLS); blocks until the next one exists."""
    if stream.live is None:
        raise _unknown(request)
    number, index = int(request.match_info["segment"]), int(request.match_info["part"])
    part = await wait_for_part(stream.live, number, index)
    if part is None:
        return error_response(404, f"no part {number}.{index}: expired, or not available yet")
    return _media(request, part.data)


def _media(request: web.Request, data: bytes) -> web.Response:
    """Return immutable media, to be cached briefly: a restarted site may use its segment numbers again."""
    plan = request.app[SERVICE].streams.segment_plan
    max_age_s = int(2 * plan.playlist_length * plan.segment_frames / plan.fps)
    headers = {**_ANY_ORIGIN, "Cache-Control": f"public, max-age={max_age_s}, immutable"}
    return web.Response(body=data, content_type="video/mp4", headers=headers)


def _stream(request: web.Request) -> HlsStream:
    """Return the stream of a request.

    Raises:
        RefusedError: the stream is neither live nor recorded.
    """
    service = request.app[SERVICE]
    if "camera" in request.match_info:
        camera = request.match_info["camera"]
        recorded = service.recordings.of_camera(camera)
        return HlsStream(service.streams.segments_of_camera(camera), recorded)
    number, scoped = int(request.match_info["object"]), is_scoped_to_person(request)
    live = service.streams.segments_of_person(
        service.people.current_number(number), scoped_to_person=scoped, is_smooth=_is_smooth(request)
    )
    stream = HlsStream(live, service.recordings.of_person(number, scoped_to_person=scoped))
    if not stream.exists:
        raise _unknown(request)
    return stream


def _is_smooth(request: web.Request) -> bool:
    return requested_delay(request) is DelayMode.SMOOTH


def _client(request: web.Request) -> HlsClient:
    """Return the player that sent a request, identified by client, address and User-Agent."""
    service, names = request.app[SERVICE], request.match_info
    if "camera" in names:
        stream = hls_camera_slot_name(names["camera"])
    else:
        stream = person_slot_name(service.people.current_number(int(names["object"])))
    client = request.app[ACCESS].client_of(request)
    return HlsClient(
        stream, client, request.remote or "", request.headers.get("User-Agent", "")[:_AGENT_CHARS]
    )


def _connected_viewers(request: web.Request) -> tuple[str, int]:
    """Return the slot name of the stream's viewers outside HLS, and their number."""
    service, names = request.app[SERVICE], request.match_info
    if "camera" in names:
        return live_camera_slot_name(names["camera"]), service.streams.of_camera(names["camera"]).viewers
    number = service.people.current_number(int(names["object"]))
    return person_slot_name(number), service.streams.connected_viewers_of_person(number)


def _unknown(request: web.Request) -> RefusedError:
    return request.app[SERVICE].people.unknown(int(request.match_info["object"]))
