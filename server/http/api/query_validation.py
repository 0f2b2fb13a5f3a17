"""What may be asked of a stream after the question mark: nothing that is meant is passed over in silence."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from aiohttp import web

from server.http.api.handlers import problem

OVERLAY = {
    "/objects/{object}/best.mp4",
    "/objects/{object}/best.mjpeg",
    "/objects/{object}/best.jpg",
    "/cameras/{camera}/live.mjpeg",
    "/cameras/{camera}/live.jpg",
}
"""What boxes can be burnt into."""
PAST = {
    "/objects/{object}/best.mp4",
    "/objects/{object}/best.ts",
    "/cameras/{camera}/live.mp4",
    "/cameras/{camera}/live.ts",
    "/objects/{object}/hls/index.m3u8",
    "/cameras/{camera}/hls/index.m3u8",
    "/api/past",
}
"""What can begin in the past."""
HELD = {"/objects/{object}/best.mp4", "/objects/{object}/best.webm", "/objects/{object}/best.ts"}
"""What can be held to one camera, or prefer one."""
_STREAMS = ("/objects/", "/cameras/")


@web.middleware
async def refuse_what_is_not_there(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer 400 where a stream is asked for boxes, a past or a camera that it does not have."""
    resource = request.match_info.route.resource
    if resource is not None and request.query and request.path.startswith(_STREAMS):
        complaint = _complaint(request, resource.canonical)
        if complaint is not None:
            return problem(400, complaint)
    return await handler(request)


def _complaint(request: web.Request, path: str) -> str | None:
    overlay = request.query.get("overlay", "0")
    if overlay not in {"0", "1"}:
        return f"overlay={overlay}: must be 0 or 1"
    if overlay == "1" and path not in OVERLAY:
        return "overlay: boxes are burnt into a person's best.mp4, and into .mjpeg and .jpg; not into this"
    for name, done in (("camera", "be held to one"), ("prefer", "prefer a camera")):
        others = {"overlay", "from", "to", "camera", "prefer"} - {name}
        if name in request.query and (path not in HELD or request.query.keys() & others):
            return f"{name}: a person's live best.mp4, best.ts or best.webm can {done}, and nothing else"
    for name in ("from", "to"):
        if name in request.query and path not in PAST:
            return f"{name}: only .mp4, .ts and HLS can begin in the past"
    return None
