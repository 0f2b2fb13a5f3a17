"""Routes that are allowed to viewers who see people pixelated.

Streams that are passed on as the cameras encode them cannot be changed. Such a viewer gets only those that
the server draws, and nothing else that identifies people. A route that is not listed here is refused.
"""

from __future__ import annotations

from aiohttp import web

from server.http.access.csrf import route_pattern
from server.http.access.permissions import Permission, Scope
from server.http.json_responses import error_response

_DRAWN = {
    "/objects/{object}/best.mp4",
    "/objects/{object}/best.mjpeg",
    "/objects/{object}/best.jpg",
    "/cameras/{camera}/live.mjpeg",
    "/cameras/{camera}/live.jpg",
}
"""Streams that are drawn; their handlers hide people."""
_WITHOUT_PICTURES = {
    "/api/session",
    "/api/site",
    "/api/delays",
    "/api/objects",
    "/api/cameras",
    "/api/events",
    "/api/flags",
    "/api/objects/{object}/choice",
}
"""Numbers and positions; names, thumbnails and events of rules are left out."""
_OTHER_STREAMS = ("from", "to", "camera", "prefer")
"""Queries that ask for a stream that is not drawn."""


def refuse_unblurred(request: web.Request, permission: Permission, scope: Scope) -> web.Response | None:
    """Return 403 for a request that would show a viewer people who are to be pixelated; None: it does not."""
    if scope.blur is None or permission is Permission.OPERATE:
        return None
    query = next((name for name in _OTHER_STREAMS if name in request.query), None)
    if query is None and request.query.get("delay") == "live":
        query = "delay=live"
    if query is None and route_pattern(request) in _DRAWN | _WITHOUT_PICTURES:
        return None
    return error_response(
        403,
        f"{query or request.path}: not with people blurred; there are best.mp4, best.mjpeg, best.jpg, "
        "live.mjpeg and live.jpg, of now",
    )
