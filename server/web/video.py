"""The streams over HTTP: the best view of a person, and a camera as it is."""

from __future__ import annotations

from aiohttp import web

from server.view.channel import Channel
from server.view.fmp4 import init_segment
from server.web.api import problem
from server.web.keys import SERVICE
from server.web.pictures import best_with_boxes, wants_boxes
from server.web.streams import send_stream

routes = web.RouteTableDef()

_RETRY_S = "5"


@routes.get("/objects/{object:[0-9]{1,9}}/best.mp4")
async def get_best(request: web.Request) -> web.StreamResponse:
    """Stream the best view of a person as fragmented MP4; it goes on across every cut."""
    if wants_boxes(request):
        return await best_with_boxes(request)
    service = request.app[SERVICE]
    number = int(request.match_info["object"])
    channel = service.splicer.objects.get(service.board.resolve(number))
    if channel is None:
        return problem(404, f"there is no object {number}")
    return await _mp4(request, channel)


@routes.get("/cameras/{camera}/live.mp4")
async def get_live(request: web.Request) -> web.StreamResponse:
    """Stream one camera as fragmented MP4."""
    service = request.app[SERVICE]
    camera = request.match_info["camera"]
    channel = service.splicer.cameras.get(camera)
    if channel is None:
        return problem(404, f"there is no camera {camera!r}; there are {', '.join(service.shelves)}")
    return await _mp4(request, channel)


async def _mp4(request: web.Request, channel: Channel) -> web.StreamResponse:
    service = request.app[SERVICE]
    parameters, site = service.agreement.parameters, service.config.site
    if parameters is None:
        return _not_now("no camera has delivered a picture yet")
    if service.splicer.viewers >= service.config.http.viewers_max:
        return _not_now("as many viewers as this server takes (http.viewers_max) are watching")
    head = init_segment(parameters, site.width, site.height)
    return await send_stream(request, channel, head, {"Content-Type": "video/mp4"})


def _not_now(error: str) -> web.Response:
    response = problem(503, error)
    response.headers["Retry-After"] = _RETRY_S
    return response
