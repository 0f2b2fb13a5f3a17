"""The API: JSON about people, why each view was chosen, and how the server is."""

from __future__ import annotations

from typing import Any, TypeVar

import msgspec
from aiohttp import web
from prometheus_client import CollectorRegistry, generate_latest

from server.http.api.responses import choice_info, thumbnail_of
from server.http.api.schema import Problem
from server.http.app_keys import METRICS, SERVICE
from server.http.connections.listener import still_coming
from server.messaging.messages import DECODE_ERRORS
from server.service.readiness import why_not_ready
from server.service.service import BestViewService
from server.service.time_shift.time_reference import TimeReferenceError, parse_time_reference

routes = web.RouteTableDef()

_RETRY_S = "5"

Asked = TypeVar("Asked")


def answer(content: Any, status: int = 200) -> web.Response:
    """Give a JSON answer."""
    return web.Response(
        body=msgspec.json.encode(content),
        status=status,
        content_type="application/json",
        headers={"Cache-Control": "no-store", "Access-Control-Allow-Origin": "*"},
    )


def problem(status: int, error: str) -> web.Response:
    """Say in one line why there is no answer."""
    return answer(Problem(error), status)


def no_camera(service: BestViewService, camera: str) -> web.Response:
    """Say that there is no camera of this name, and which there are."""
    return problem(404, f"there is no camera {camera!r}; there are {', '.join(service.frame_buffers)}")


def no_object(service: BestViewService, number: int) -> web.Response:
    """Say that nobody has this number, not any more, or not yet again: then, when to try again."""
    if service.remembering.awaits(number):
        return not_now(f"object {number} cannot be shown yet")
    return problem(404, f"there is no object {number}")


def not_now(error: str) -> web.Response:
    """Say why not, and when to try again."""
    response = problem(503, error)
    response.headers["Retry-After"] = _RETRY_S
    return response


async def asked_for(request: web.Request, kind: type[Asked]) -> Asked:
    """Read what a request asks for.

    Raises:
        HTTPBadRequest: it is not JSON of that kind.
    """
    try:
        with still_coming(request):
            asked = await request.read()
        return msgspec.json.decode(asked, type=kind)
    except DECODE_ERRORS as error:
        raise web.HTTPBadRequest(reason=f"the request's JSON: {' '.join(str(error).split())}") from error


def _service(request: web.Request) -> BestViewService:
    return request.app[SERVICE]


@routes.get("/api/objects/{object:[0-9]{1,9}}/choice")
async def get_choice(request: web.Request) -> web.Response:
    """Say which camera shows this person, or did at a moment of the last minute, since when, and why."""
    service, number = _service(request), int(request.match_info["object"])
    if "at" not in request.query:
        choice = choice_info(service, number)
        return no_object(service, number) if choice is None else answer(choice)
    try:
        pulse = parse_time_reference(
            request.query["at"],
            now=service.board.end - 1,
            fps=service.config.site.fps,
            pulse0=service.pulse0,
        )
    except TimeReferenceError as error:
        return problem(400, f"at: {error}")
    choice = choice_info(service, number, pulse)
    if choice is None:
        return problem(404, f"nothing is kept of why object {number} was shown as it was at pulse {pulse}")
    return answer(choice)


@routes.get("/objects/{object:[0-9]{1,9}}/thumb.jpg")
async def get_thumbnail(request: web.Request) -> web.Response:
    """Give a small picture of this person."""
    service = _service(request)
    number = int(request.match_info["object"])
    thumbnail = thumbnail_of(service, service.board.resolve(number))
    if thumbnail is None:
        return problem(404, f"there is no picture of object {number}")
    return web.Response(
        body=thumbnail.jpeg, content_type="image/jpeg", headers={"Cache-Control": "private, max-age=60"}
    )


@routes.get("/healthz")
async def get_health(request: web.Request) -> web.Response:
    """Say that the process answers."""
    del request
    return web.Response(text="ok\n")


@routes.get("/readyz")
async def get_ready(request: web.Request) -> web.Response:
    """Say whether a best view can be served now: pulses and frames come, decisions keep up; or why not."""
    service = _service(request)
    reasons = why_not_ready(service)
    if reasons:
        return web.Response(text=f"{'; '.join(reasons)}\n", status=503)
    live = [camera for camera, state in service.intake.states.items() if state.word == "live"]
    writer = service.past.writer
    stands = f"; nothing is recorded: {writer.stands}" if writer is not None and writer.stands else ""
    return web.Response(text=f"{len(live)} of {len(service.intake.states)} cameras{stands}\n")


@routes.get("/metrics")
async def get_metrics(request: web.Request) -> web.Response:
    """Give the metrics in Prometheus' text format."""
    metrics: CollectorRegistry = request.app[METRICS]
    return web.Response(body=generate_latest(metrics), headers={"Content-Type": "text/plain; version=0.0.4"})
