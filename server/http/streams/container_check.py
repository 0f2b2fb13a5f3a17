"""Which streams a site has: those of its own codec, and nothing is made into another."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable

from aiohttp import web

from server.http.api.handlers import problem
from server.http.app_keys import SERVICE

_STREAM = re.compile(
    r"/(?:objects|cameras)/[^/]+/(?:(?:best|live)\.[a-z0-9]+|hls/.*)|/api/(?:objects|cameras)/[^/]+/past"
)


@web.middleware
async def refuse_other_containers(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer 404 where a stream is asked for that only sites of another codec have."""
    if _STREAM.fullmatch(request.path):
        container, is_webm = request.app[SERVICE].agreement.container, request.path.endswith(".webm")
        if container == "webm" and not request.path.endswith((".webm", ".mjpeg", ".jpg")):
            return problem(
                404, "these streams are VP8 (encode.codec): there is best.webm, live.webm and JPEG"
            )
        if container == "mp4" and is_webm:
            return problem(404, "these streams are H.264 (encode.codec): there is best.mp4 and live.mp4")
    return await handler(request)
