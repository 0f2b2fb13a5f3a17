"""``/api/operator/cameras``, ``pulses`` and ``floor``: how the cameras work, and what they cover."""

from __future__ import annotations

from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SERVICE
from server.http.json_responses import json_response
from server.http.operator.schema import OperatorCameras

routes = web.RouteTableDef()


@routes.get(f"{OPERATOR_PATH}/cameras")
async def get_cameras(request: web.Request) -> web.Response:
    """Return every camera's status: state, frame rate, sync error, tracking delay, last problem."""
    return json_response(OperatorCameras(request.app[SERVICE].cameras.diagnose_cameras()))


@routes.get(f"{OPERATOR_PATH}/pulses")
async def get_pulses(request: web.Request) -> web.Response:
    """Ask the pulse server who its clients are."""
    return json_response(await request.app[SERVICE].operations.list_pulse_clients())


@routes.get(f"{OPERATOR_PATH}/floor")
async def get_floor(request: web.Request) -> web.Response:
    """Return the coverage of the shared floor by the cameras."""
    return json_response(request.app[SERVICE].cameras.map_floor())
