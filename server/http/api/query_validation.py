"""Query validation: a stream refuses query parameters that it does not support instead of ignoring them."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from aiohttp import web

from server.http.json_responses import error_response

OVERLAY = {
    "/objects/{object}/best.mp4",
    "/objects/{object}/best.mjpeg",
    "/objects/{object}/best.jpg",
    "/cameras/{camera}/live.mjpeg",
    "/cameras/{camera}/live.jpg",
}
"""Routes that support overlay=: boxes burnt in."""
TIME_SHIFT = {
    "/objects/{object}/best.mp4",
    "/objects/{object}/best.ts",
    "/cameras/{camera}/live.mp4",
    "/cameras/{camera}/live.ts",
    "/objects/{object}/hls/index.m3u8",
    "/cameras/{camera}/hls/index.m3u8",
    "/api/past",
}
"""Routes that support from= and to=: streams that begin in the past."""
CAMERA_QUERY = {"/objects/{object}/best.mp4", "/objects/{object}/best.webm", "/objects/{object}/best.ts"}
"""Routes that support camera= and prefer=: a fixed or a preferred camera."""
_STREAMS = ("/objects/", "/cameras/")


@web.middleware
async def validate_query(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer 400 where a stream does not support a query parameter."""
    resource = request.match_info.route.resource
    if resource is not None and request.query and request.path.startswith(_STREAMS):
        error = _query_error(request, resource.canonical)
        if error is not None:
            return error_response(400, error)
    return await handler(request)


def _query_error(request: web.Request, path: str) -> str | None:
    overlay = request.query.get("overlay", "0")
    if overlay not in {"0", "1"}:
        return f"overlay={overlay}: must be 0 or 1"
    if overlay == "1" and path not in OVERLAY:
        return "overlay: boxes are burnt into a person's best.mp4, and into .mjpeg and .jpg; not into this"
    for name, done in (("camera", "be held to one"), ("prefer", "prefer a camera")):
        others = {"overlay", "from", "to", "camera", "prefer"} - {name}
        if name in request.query and (path not in CAMERA_QUERY or request.query.keys() & others):
            return f"{name}: a person's live best.mp4, best.ts or best.webm can {done}, and nothing else"
    for name in ("from", "to"):
        if name in request.query and path not in TIME_SHIFT:
            return f"{name}: only .mp4, .ts and HLS can begin in the past"
    return None
