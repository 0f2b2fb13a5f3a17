"""The operator's routes: the page, cameras, pulse clients and floor here; the others from their modules."""

from __future__ import annotations

from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SERVICE
from server.http.json_responses import json_response
from server.http.operator import (
    camera_search,
    deletion,
    downloads,
    marked_points,
    people,
    position_corrections,
    restart,
    settings,
    site_cameras,
    site_settings,
    trials,
    walk,
    zones,
)
from server.http.operator.schema import CameraDiagnosticsList
from server.http.static_files import page_file

_status_routes = web.RouteTableDef()


@_status_routes.get("/operator")
async def get_operator_page(request: web.Request) -> web.StreamResponse:
    """Return the operator's page; its data is fetched separately."""
    return page_file("operator.html", request.app[SERVICE].config.view.sharding.servers)


@_status_routes.get(f"{OPERATOR_PATH}/cameras")
async def get_cameras(request: web.Request) -> web.Response:
    """Return every camera's diagnostics: state, frame rate, sync error, tracking delay, last error."""
    return json_response(CameraDiagnosticsList(request.app[SERVICE].cameras.diagnose_cameras()))


@_status_routes.get(f"{OPERATOR_PATH}/pulses")
async def get_pulse_clients(request: web.Request) -> web.Response:
    """Query the pulse server for its clients."""
    return json_response(await request.app[SERVICE].operations.list_pulse_clients())


@_status_routes.get(f"{OPERATOR_PATH}/floor")
async def get_floor(request: web.Request) -> web.Response:
    """Return the coverage of the shared floor by the cameras."""
    return json_response(request.app[SERVICE].cameras.map_floor())


routes = [
    *_status_routes,
    *settings.routes,
    *people.routes,
    *deletion.routes,
    *position_corrections.routes,
    *downloads.routes,
    *walk.routes,
    *marked_points.routes,
    *restart.routes,
    *camera_search.routes,
    *trials.routes,
    *site_cameras.routes,
    *site_settings.routes,
    *zones.routes,
]
