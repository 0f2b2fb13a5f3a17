"""HTTP Live Streaming (RFC 8216): the streams in segments of fragmented MP4, for players that fetch."""

from __future__ import annotations

from datetime import UTC, datetime

from aiohttp import web

from server.view.fmp4 import init_segment
from server.view.reel import Plan, Reel, Segment
from server.web.api import not_now, problem
from server.web.keys import SERVICE

routes = web.RouteTableDef()

PLAYLIST = "application/vnd.apple.mpegurl"
_VERSION = 7
"""Of the protocol: the first whose segments may be fragmented MP4."""
_ANYBODY = {"Access-Control-Allow-Origin": "*"}
_OBJECT = "/objects/{object:[0-9]{1,9}}/hls"
_CAMERA = "/cameras/{camera}/hls"
_NUMBER = "{segment:[0-9]{1,12}}"


@routes.get(_OBJECT + "/index.m3u8")
async def get_best_playlist(request: web.Request) -> web.Response:
    """List the newest segments of the best view of a person (HLS)."""
    return _playlist(request)


@routes.get(_OBJECT + "/init.mp4")
async def get_best_init(request: web.Request) -> web.Response:
    """Give what a player needs before the first segment of a person (HLS)."""
    return _init(request)


@routes.get(_OBJECT + f"/{_NUMBER}.m4s")
async def get_best_segment(request: web.Request) -> web.Response:
    """Give a segment of the best view of a person (HLS)."""
    return _segment(request)


@routes.get(_CAMERA + "/index.m3u8")
async def get_live_playlist(request: web.Request) -> web.Response:
    """List the newest segments of a camera (HLS)."""
    return _playlist(request)


@routes.get(_CAMERA + "/init.mp4")
async def get_live_init(request: web.Request) -> web.Response:
    """Give what a player needs before the first segment of a camera (HLS)."""
    return _init(request)


@routes.get(_CAMERA + f"/{_NUMBER}.m4s")
async def get_live_segment(request: web.Request) -> web.Response:
    """Give a segment of a camera (HLS)."""
    return _segment(request)


def playlist(reel: Reel, pulse0: float | None) -> str:
    """Write the playlist of a stream; ``pulse0`` is when pulse 0 was due, unix seconds.

    Segments are numbered by their pulses: whoever writes the playlist anew writes the same numbers.
    """
    listed = reel.listed
    lines = [
        "#EXTM3U",
        f"#EXT-X-VERSION:{_VERSION}",
        f"#EXT-X-TARGETDURATION:{reel.plan.target_s}",
        f"#EXT-X-MEDIA-SEQUENCE:{listed[0].number if listed else 0}",
        "#EXT-X-INDEPENDENT-SEGMENTS",
        '#EXT-X-MAP:URI="init.mp4"',
    ]
    for segment in listed:
        lines += _lines(segment, reel.plan, pulse0)
    lines += ["#EXT-X-ENDLIST"] if reel.ended else []
    return "\n".join(lines) + "\n"


def _lines(segment: Segment, plan: Plan, pulse0: float | None) -> list[str]:
    lines = [f"#EXTINF:{segment.seconds:.5f},", f"{segment.number}.m4s"]
    if pulse0 is None:
        return lines
    when = datetime.fromtimestamp(pulse0 + segment.first / plan.fps, UTC)
    told = when.isoformat(timespec="milliseconds").replace("+00:00", "Z")
    return [f"#EXT-X-PROGRAM-DATE-TIME:{told}", *lines]


def _playlist(request: web.Request) -> web.Response:
    service = request.app[SERVICE]
    reel = _reel(request)
    if reel is None:
        return _nobody(request)
    if not reel.listed:
        return not_now("the first segment is not whole yet")
    text = playlist(reel, service.pulse0)
    return web.Response(
        text=text, content_type=PLAYLIST, charset="utf-8", headers={**_ANYBODY, "Cache-Control": "no-cache"}
    )


def _init(request: web.Request) -> web.Response:
    service = request.app[SERVICE]
    parameters, site = service.agreement.parameters, service.config.site
    if _reel(request) is None:
        return _nobody(request)
    if parameters is None:
        return not_now("no camera has delivered a picture yet")
    return _media(request, init_segment(parameters, site.width, site.height, service.config.sound.format))


def _segment(request: web.Request) -> web.Response:
    reel = _reel(request)
    if reel is None:
        return _nobody(request)
    segment = reel.get(int(request.match_info["segment"]))
    if segment is None:
        return problem(404, f"there is no segment {request.match_info['segment']} here, or not any more")
    return _media(request, segment.data)


def _media(request: web.Request, data: bytes) -> web.Response:
    """Give bytes that never change. A site that starts anew counts anew: they are not kept for long."""
    plan = request.app[SERVICE].splicer.plan
    kept_s = int(2 * plan.listed * plan.frames / plan.fps)
    headers = {**_ANYBODY, "Cache-Control": f"public, max-age={kept_s}, immutable"}
    return web.Response(body=data, content_type="video/mp4", headers=headers)


def _reel(request: web.Request) -> Reel | None:
    service = request.app[SERVICE]
    if "camera" in request.match_info:
        return service.splicer.camera_reel(request.match_info["camera"])
    return service.splicer.reel(service.board.resolve(int(request.match_info["object"])))


def _nobody(request: web.Request) -> web.Response:
    if "camera" in request.match_info:
        cameras = ", ".join(request.app[SERVICE].shelves)
        return problem(404, f"there is no camera {request.match_info['camera']!r}; there are {cameras}")
    return problem(404, f"there is no object {request.match_info['object']}")
