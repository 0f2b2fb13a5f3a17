"""Container check: a site has streams in the containers of its own codec, and transcodes into no other."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable

from aiohttp import web

from server.http.app_keys import SERVICE
from server.http.json_responses import error_response

_STREAM = re.compile(
    r"/(?:objects|cameras)/[^/]+/(?:(?:best|live)\.[a-z0-9]+|hls/.*)|/api/(?:objects|cameras)/[^/]+/past"
)


@web.middleware
async def check_container(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer 404 where a stream is requested in a container of another codec."""
    if _STREAM.fullmatch(request.path):
        container, is_webm = request.app[SERVICE].streams.container, request.path.endswith(".webm")
        if container == "webm" and not request.path.endswith((".webm", ".mjpeg", ".jpg")):
            return error_response(
                404, "these streams are VP8 (encode.codec): there is best.webm, live.webm and JPEG"
            )
        if container == "mp4" and is_webm:
            return error_response(
                404, "these streams are H.264 (encode.codec): there is best.mp4 and live.mp4"
            )
    return await handler(request)
