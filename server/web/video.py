"""The streams over HTTP: the best view of a person, and a camera as it is."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from aiohttp import web

from server.view.channel import Channel, Piece
from server.view.fmp4 import init_segment
from server.view.footage import Footage
from server.web.api import not_now, problem
from server.web.keys import SERVICE
from server.web.limits import no_place
from server.web.past import asks_for_the_past, best_of_the_past, camera_of_the_past
from server.web.pictures import best_with_boxes, wants_boxes
from server.web.streams import send_stream

routes = web.RouteTableDef()

Sender = Callable[[web.Request, Channel], Awaitable[web.StreamResponse]]


@routes.get("/objects/{object:[0-9]{1,9}}/best.mp4")
async def get_best(request: web.Request) -> web.StreamResponse:
    """Stream the best view of a person as fragmented MP4; it goes on across every cut."""
    if asks_for_the_past(request):
        return await best_of_the_past(request)
    if wants_boxes(request):
        return await best_with_boxes(request)
    return await _best(request, _mp4)


@routes.get("/objects/{object:[0-9]{1,9}}/best.ts")
async def get_best_ts(request: web.Request) -> web.StreamResponse:
    """Stream the best view of a person as an MPEG transport stream, likewise."""
    return await _best(request, _ts)


@routes.get("/cameras/{camera}/live.mp4")
async def get_live(request: web.Request) -> web.StreamResponse:
    """Stream one camera as fragmented MP4."""
    if asks_for_the_past(request):
        return await camera_of_the_past(request)
    return await _live(request, _mp4)


@routes.get("/cameras/{camera}/live.ts")
async def get_live_ts(request: web.Request) -> web.StreamResponse:
    """Stream one camera as an MPEG transport stream."""
    return await _live(request, _ts)


async def _best(request: web.Request, send: Sender) -> web.StreamResponse:
    service = request.app[SERVICE]
    number = int(request.match_info["object"])
    channel = service.splicer.objects.get(service.board.resolve(number))
    if channel is None:
        return problem(404, f"there is no object {number}")
    return await send(request, channel)


async def _live(request: web.Request, send: Sender) -> web.StreamResponse:
    service = request.app[SERVICE]
    camera = request.match_info["camera"]
    channel = service.splicer.cameras.get(camera)
    if channel is None:
        return problem(404, f"there is no camera {camera!r}; there are {', '.join(service.shelves)}")
    return await send(request, channel)


async def _mp4(request: web.Request, channel: Channel) -> web.StreamResponse:
    service = request.app[SERVICE]
    parameters, site = service.agreement.parameters, service.config.site
    if parameters is None:
        return not_now("no camera has delivered a picture yet")
    full = no_place(request, channel.viewers)
    if full is not None:
        return full
    head = init_segment(parameters, site.width, site.height, service.config.sound.format)
    return await send_stream(request, channel, head, {"Content-Type": "video/mp4"}, _with_sound)


async def _ts(request: web.Request, channel: Channel) -> web.StreamResponse:
    full = no_place(request, channel.viewers)
    if full is not None:
        return full
    return await send_stream(request, channel, b"", {"Content-Type": "video/mp2t"}, _as_ts)


def _with_sound(piece: Piece) -> bytes:
    return piece.with_sound if isinstance(piece, Footage) else piece.data


def _as_ts(piece: Piece) -> bytes:
    return piece.ts if isinstance(piece, Footage) else piece.data
