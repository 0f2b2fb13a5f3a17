"""Where the operator points at somebody in a camera's picture."""

from __future__ import annotations

from typing import Annotated

import msgspec
from aiohttp import web

from server.http.access.grants import OPERATING
from server.http.api.handlers import answer, asked_for, no_camera, no_object, problem
from server.http.app_keys import SERVICE
from server.http.operator.schema import Pointing
from server.messaging.number_types import Pulse
from server.messaging.operator_messages import OPERATOR_POINTS_MAX, TOLERANCE_MIN
from server.service.operator_assist.corrections import PointedPosition
from server.service.service import BestViewService

routes = web.RouteTableDef()

_REACH = 0.02
"""How far off a place may be where nobody says so, as a share of the picture's width."""
_REACH_MOST = 0.5


class Point(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A place in a frame, in pixels of the site's picture."""

    pulse: Pulse
    x: float
    y: float
    reach: Annotated[float, msgspec.Meta(gt=0)] | None = None
    """How far off it may be; null: a little."""


class Said(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where somebody is in one camera's picture."""

    object: int
    camera: str
    points: Annotated[list[Point], msgspec.Meta(min_length=1, max_length=OPERATOR_POINTS_MAX)]


@routes.get(f"{OPERATING}/pointing")
async def get_pointing(request: web.Request) -> web.Response:
    """Say whether anybody can be pointed at, and how far back."""
    return answer(_told(request.app[SERVICE], 0, 0, []))


@routes.post(f"{OPERATING}/pointing")
async def post_pointing(request: web.Request) -> web.Response:
    """Say where somebody is in a camera's picture: its tracker goes by that, also in the past."""
    service = request.app[SERVICE]
    said = await asked_for(request, Said)
    if _cannot(service):
        return problem(409, _cannot(service))
    if said.camera not in service.frame_buffers:
        return no_camera(service, said.camera)
    people = service.decider.people
    number = people.roll.whose(said.object)
    if number not in people.known:
        return no_object(service, said.object)
    wrong = next(filter(None, (_wrong(service, it) for it in said.points)), "")
    if wrong:
        return problem(400, wrong)
    places = [_place(it, service.config.site.width) for it in said.points]
    taken, flags = service.assist.point(number, said.camera, places)
    if taken:
        return answer(_told(service, taken, len(places) - taken, flags))
    return problem(409, f"camera {said.camera} has not shown object {number} then, or it is too long ago")


def _wrong(service: BestViewService, point: Point) -> str:
    site = service.config.site
    if not (0 <= point.x <= site.width and 0 <= point.y <= site.height):
        return f"points: {point.x:g}, {point.y:g} is not in a picture of {site.width}x{site.height}"
    return f"points: pulse {point.pulse} has not come yet" if point.pulse > service.pulse else ""


def _place(point: Point, width: int) -> PointedPosition:
    reach = _REACH * width if point.reach is None else min(point.reach, _REACH_MOST * width)
    return PointedPosition(point.pulse, point.x, point.y, max(reach, TOLERANCE_MIN))


def _cannot(service: BestViewService) -> str:
    if service.config.view.share.of > 1:
        return "several services share this site (view.share): they must agree who is who, by themselves"
    if not service.config.track.assist.enabled:
        return "no camera takes a pointing: track.assist.enabled is off"
    return ""


def _told(service: BestViewService, taken: int, left_out: int, flags: list[int]) -> Pointing:
    memory = service.config.track.assist.memory_frames
    return Pointing(memory, OPERATOR_POINTS_MAX, _cannot(service), taken, left_out, flags)
