"""``/api/operator/position_corrections``: the operator corrects a person's position in a camera's picture."""

from __future__ import annotations

from typing import Annotated

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SERVICE
from server.http.json_requests import json_body
from server.http.json_responses import json_response
from server.http.operator.schema import CorrectionStatus
from server.messaging.number_types import Pulse
from server.service.facade.assist import CORRECTIONS_MAX, CorrectionResult, CorrectPositions, OperatorPosition
from server.service.service import BestViewService

routes = web.RouteTableDef()

_PATH = f"{OPERATOR_PATH}/position_corrections"


class CorrectionBody(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The person's position in a frame, in pixels of the site's picture."""

    pulse: Pulse
    x: float
    y: float
    tolerance: Annotated[float, msgspec.Meta(gt=0)] | None = None
    """Tolerance in pixels; null: a default."""


class CorrectionsBody(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Positions of a person in one camera's picture."""

    object: int
    camera: str
    corrections: Annotated[list[CorrectionBody], msgspec.Meta(min_length=1, max_length=CORRECTIONS_MAX)]


@routes.get(_PATH)
async def get_position_corrections(request: web.Request) -> web.Response:
    """Return whether position corrections are accepted, and how far back."""
    return json_response(_status(request.app[SERVICE], CorrectionResult(0, []), 0))


@routes.post(_PATH)
@json_body(CorrectionsBody)
async def post_position_corrections(request: web.Request, body: CorrectionsBody) -> web.Response:
    """Correct a person's position in a camera's picture, now or in the past; its tracker uses it."""
    service = request.app[SERVICE]
    positions = [
        OperatorPosition(correction.pulse, correction.x, correction.y, correction.tolerance)
        for correction in body.corrections
    ]
    result = service.assist.correct_positions(CorrectPositions(body.object, body.camera, positions))
    return json_response(_status(service, result, len(positions) - result.accepted))


def _status(service: BestViewService, result: CorrectionResult, too_old: int) -> CorrectionStatus:
    assist = service.assist
    return CorrectionStatus(
        memory_frames=assist.memory_frames,
        max_corrections=CORRECTIONS_MAX,
        unavailable=assist.why_unavailable,
        accepted=result.accepted,
        too_old=too_old,
        flags=result.flags,
    )
