"""Validation of stream requests: supported query parameters, and a container that fits the site's codec.

Unsupported query parameters are refused instead of ignored.
"""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable

from aiohttp import web

from server.http.access.authorization import blur_of, is_scoped_to_person
from server.http.app_keys import SERVICE
from server.http.json_responses import error_response
from server.service.facade.streams import DelayMode

OVERLAY = {
    "/objects/{object}/best.mp4",
    "/objects/{object}/best.mjpeg",
    "/objects/{object}/best.jpg",
    "/cameras/{camera}/live.mjpeg",
    "/cameras/{camera}/live.jpg",
}
"""Routes that support overlay=, which burns boxes in."""
TRANSCODED = {"/objects/{object}/best.mp4", "/cameras/{camera}/live.mp4"}
"""Routes that support codec=, H.264 where the site's streams are of another codec."""
TIME_SHIFT = {
    "/objects/{object}/best.mp4",
    "/objects/{object}/best.ts",
    "/cameras/{camera}/live.mp4",
    "/cameras/{camera}/live.ts",
    "/objects/{object}/hls/index.m3u8",
    "/cameras/{camera}/hls/index.m3u8",
    "/api/past",
}
"""Routes that support from= and to= (time shift)."""
CAMERA_QUERY = {"/objects/{object}/best.mp4", "/objects/{object}/best.webm", "/objects/{object}/best.ts"}
"""Routes that support camera= and prefer=, a fixed or a preferred camera."""
DELAY = {
    "/objects/{object}/best.mp4",
    "/objects/{object}/best.webm",
    "/objects/{object}/best.ts",
    "/objects/{object}/best.mjpeg",
    "/objects/{object}/best.jpg",
    "/objects/{object}/hls/index.m3u8",
    "/objects/{object}/hls/init.mp4",
    "/objects/{object}/hls/{segment}.m4s",
    "/objects/{object}/hls/{segment}.{part}.m4s",
    "/objects/{object}/whep",
    "/api/events",
}
"""Routes that support delay=, a choice of how much is known of what follows."""
_STREAM_PREFIXES = ("/objects/", "/cameras/")
_CONTAINER_PATH = re.compile(
    r"/(?:objects|cameras)/[^/]+/(?:(?:best|live)\.[a-z0-9]+|hls/.*)|/api/(?:objects|cameras)/[^/]+/past"
)
"""Paths whose answers depend on the container."""


@web.middleware
async def validate_query(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer 400 where a stream does not support a query parameter."""
    resource = request.match_info.route.resource
    if resource is not None and request.query and request.path.startswith(_STREAM_PREFIXES):
        error = _invalid_query(request, resource.canonical)
        if error is not None:
            return error_response(400, error)
    return await handler(request)


@web.middleware
async def check_container(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer 404 where a stream is requested in a container of another codec, and is not encoded anew."""
    resource = request.match_info.route.resource
    is_encoded = wants_h264(request) and resource is not None and resource.canonical in TRANSCODED
    is_drawn = blur_of(request) is not None or is_encoded
    if _CONTAINER_PATH.fullmatch(request.path) and not is_drawn:
        container, is_webm = request.app[SERVICE].streams.container, request.path.endswith(".webm")
        if container == "webm" and not request.path.endswith((".webm", ".mjpeg", ".jpg")):
            return error_response(
                404, "these streams are VP8 (encode.codec): there is best.webm, live.webm and JPEG"
            )
        if container == "mp4" and is_webm:
            name = "H.265" if request.app[SERVICE].config.encode.codec == "h265" else "H.264"
            return error_response(
                404, f"these streams are {name} (encode.codec): there is best.mp4 and live.mp4"
            )
    return await handler(request)


def wants_h264(request: web.Request) -> bool:
    """Return whether a request is for a stream that must be encoded anew as H.264."""
    return request.query.get("codec") == "h264" and request.app[SERVICE].config.encode.codec != "h264"


def requested_delay(request: web.Request) -> DelayMode:
    """Return the delay that a request chooses."""
    return DelayMode(request.query.get("delay", DelayMode.BALANCED))


def refuse_live_if_scoped(request: web.Request) -> web.Response | None:
    """Return 403 for a live best view with a token for one person: when they left is known only later."""
    if requested_delay(request) is DelayMode.LIVE and is_scoped_to_person(request):
        return error_response(
            403, "delay=live: a token for one person has none: it would show others after the person left"
        )
    return None


def _invalid_delay(request: web.Request, path: str) -> str | None:
    delay = request.query.get("delay")
    if delay is None:
        return None
    if path not in DELAY:
        return "delay: only best views and /api/events have a choice of delay"
    if delay not in list(DelayMode):
        return f"delay={delay}: must be one of {', '.join(DelayMode)}"
    if request.query.keys() & {"from", "to", "prefer"}:
        return "delay: not in the past, and not with a preferred camera"
    return _not_live(request, path) if delay == DelayMode.LIVE else None


def _not_live(request: web.Request, path: str) -> str | None:
    if "/hls/" in path:
        return "delay=live: HLS players stay seconds behind; use best.mp4 or best.ts"
    if request.query.get("overlay", "0") == "1":
        return "delay=live: the boxes of these pictures are not known yet"
    return None


def invalid_event_query(request: web.Request) -> str | None:
    """Return why the query of a request for events is invalid; None: it is valid."""
    return _invalid_delay(request, "/api/events")


def _invalid_codec(request: web.Request, path: str) -> str | None:
    codec = request.query.get("codec")
    if codec is None:
        return None
    if path not in TRANSCODED:
        return "codec: only best.mp4 and live.mp4 are encoded anew"
    if codec != "h264":
        return f"codec={codec}: must be h264"
    return "codec: the past is not encoded anew" if request.query.keys() & {"from", "to"} else None


def _invalid_query(request: web.Request, path: str) -> str | None:
    overlay = request.query.get("overlay", "0")
    if overlay not in {"0", "1"}:
        return f"overlay={overlay}: must be 0 or 1"
    if overlay == "1" and path not in OVERLAY:
        return "overlay: boxes are burnt into a person's best.mp4, and into .mjpeg and .jpg; not into this"
    error = _invalid_codec(request, path) or _invalid_delay(request, path)
    if error is not None:
        return error
    for name, effect in (("camera", "be fixed to one"), ("prefer", "prefer a camera")):
        excluded = {"overlay", "from", "to", "camera", "prefer"} - {name}
        if name in request.query and (path not in CAMERA_QUERY or request.query.keys() & excluded):
            return f"{name}: a person's live best.mp4, best.ts or best.webm can {effect}, and nothing else"
    for name in ("from", "to"):
        if name in request.query and path not in TIME_SHIFT:
            return f"{name}: only .mp4, .ts and HLS can begin in the past"
    return None
