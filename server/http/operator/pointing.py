"""``/api/operator/pointing``: the operator points at a person in a camera's picture."""

from __future__ import annotations

from typing import Annotated

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SERVICE
from server.http.json_responses import json_response, read_json
from server.http.operator.schema import Pointing
from server.messaging.number_types import Pulse
from server.service.facade.assist import CORRECTIONS_MAX, PointAtPerson, Pointed, PointedPlace
from server.service.service import BestViewService

routes = web.RouteTableDef()


class PointBody(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A place in a frame, in pixels of the site's picture."""

    pulse: Pulse
    x: float
    y: float
    tolerance: Annotated[float, msgspec.Meta(gt=0)] | None = None
    """Tolerance in pixels; null: a default."""


class PointingBody(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a person is in one camera's picture."""

    object: int
    camera: str
    points: Annotated[list[PointBody], msgspec.Meta(min_length=1, max_length=CORRECTIONS_MAX)]


@routes.get(f"{OPERATOR_PATH}/pointing")
async def get_pointing(request: web.Request) -> web.Response:
    """Return whether corrections of position are accepted, and how far back."""
    return json_response(_pointing(request.app[SERVICE], Pointed(0, []), 0))


@routes.post(f"{OPERATOR_PATH}/pointing")
async def post_pointing(request: web.Request) -> web.Response:
    """Correct a person's position in a camera's picture, now or in the past; its tracker uses it."""
    service = request.app[SERVICE]
    body = await read_json(request, PointingBody)
    places = [PointedPlace(it.pulse, it.x, it.y, it.tolerance) for it in body.points]
    pointed = service.assist.point_at_person(PointAtPerson(body.object, body.camera, places))
    return json_response(_pointing(service, pointed, len(places) - pointed.accepted))


def _pointing(service: BestViewService, pointed: Pointed, too_old: int) -> Pointing:
    assist = service.assist
    return Pointing(assist.memory, CORRECTIONS_MAX, assist.blocked, pointed.accepted, too_old, pointed.flags)
