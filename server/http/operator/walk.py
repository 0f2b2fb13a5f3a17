"""``/api/operator/walk``: start, follow and finish the calibration walk."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Literal

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SERVICE
from server.http.json_requests import json_body
from server.http.json_responses import error_response, json_response
from server.http.operator.config_file import change_config, config_path
from server.setup.ground import apply_ground
from server.system.errors import UserError

routes = web.RouteTableDef()


class WalkCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A command to the calibration walk."""

    action: Literal["start", "resume", "finish", "apply"]
    person: Annotated[float, msgspec.Meta(ge=0.1, le=1000)] = 1.75
    """With finish: the height of the person who walked, in meters."""


@routes.get(f"{OPERATOR_PATH}/walk")
async def get_walk(request: web.Request) -> web.Response:
    """Return the progress and the result of the calibration walk."""
    return json_response(request.app[SERVICE].calibration.status())


@routes.post(f"{OPERATOR_PATH}/walk")
@json_body(WalkCommand)
async def post_walk(request: web.Request, command: WalkCommand) -> web.Response:
    """Start or resume a walk, finish it and calibrate from it, or write the result into the configuration."""
    calibration = request.app[SERVICE].calibration
    match command.action:
        case "start":
            calibration.start()
        case "resume":
            calibration.resume()
        case "finish":
            calibration.finish(command.person)
        case "apply":
            try:
                path, ground = config_path(request), calibration.ground_file()
                if ground is None:
                    return error_response(409, "there is no calibration result yet")
                await change_config(path, partial(apply_ground, ground=ground.decode()))
            except UserError as error:
                return error_response(409, str(error))
    return json_response(calibration.status())


@routes.delete(f"{OPERATOR_PATH}/walk")
async def delete_walk(request: web.Request) -> web.Response:
    """Discard the walk and its result."""
    calibration = request.app[SERVICE].calibration
    calibration.discard()
    return json_response(calibration.status())


@routes.get(f"{OPERATOR_PATH}/walk/ground.json")
async def get_ground_file(request: web.Request) -> web.Response:
    """Return the ground file computed from the calibration walk."""
    return _file(request.app[SERVICE].calibration.ground_file(), "application/octet-stream", "ground.json")


@routes.get(f"{OPERATOR_PATH}/walk/plan.png")
async def get_plan_file(request: web.Request) -> web.Response:
    """Return the floor plan computed from the calibration walk."""
    return _file(request.app[SERVICE].calibration.floor_plan(), "image/png", "ground.png")


def _file(body: bytes | None, content_type: str, name: str) -> web.Response:
    if body is None:
        return error_response(404, "there is no calibration result yet")
    disposition = f'{"inline" if content_type == "image/png" else "attachment"}; filename="{name}"'
    headers = {"Content-Disposition": disposition, "Cache-Control": "no-store"}
    return web.Response(body=body, content_type=content_type, headers=headers)
