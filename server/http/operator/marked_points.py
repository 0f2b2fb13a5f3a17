"""``/api/operator/marked_points``: calibration from points that are marked in the cameras' pictures."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any, Literal

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import CONTROL, SERVICE
from server.http.json_requests import json_body
from server.http.json_responses import error_response, json_response
from server.http.operator.config_file import change_config, config_path
from server.http.operator.schema import MarkedPointsStatus, PointError, PointsResult
from server.setup.marked_points import (
    PointCalibration,
    PresentCalibration,
    apply_points,
    calibrate_from_points,
    draw_plan,
    present_calibration,
)
from server.system.errors import UserError

routes = web.RouteTableDef()

_PATH = f"{OPERATOR_PATH}/marked_points"


class PointsCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A calibration from marked points to compute, or to write into the configuration."""

    action: Literal["calibrate", "apply"]
    points: dict[str, Any]
    """As in a file of points for `myview calibrate`."""
    digest: str = ""
    """With apply: of the calibration that the configuration named when this one was computed."""


@routes.get(_PATH)
async def get_marked_points(request: web.Request) -> web.Response:
    """Return the present calibration, and the points that it was computed from, if it was from points."""
    try:
        return json_response(_status(await _present(request)))
    except UserError as error:
        return error_response(409, str(error))


@routes.post(_PATH)
@json_body(PointsCommand)
async def post_marked_points(request: web.Request, command: PointsCommand) -> web.Response:
    """Calibrate from points, which changes nothing, or write that into the configuration."""
    try:
        if command.action == "apply":
            apply = partial(apply_points, content=command.points, digest=command.digest)
            await change_config(config_path(request), apply)
            return json_response(_status(await _present(request)))
        present = await _present(request)
    except UserError as error:
        return error_response(409, str(error))
    try:
        calibration = await asyncio.to_thread(
            calibrate_from_points, command.points, present, picture_sizes(request)
        )
    except UserError as error:
        return error_response(400, str(error))
    return json_response(_status(present, await _result(calibration)))


async def _present(request: web.Request) -> PresentCalibration:
    """Return the calibration that the configuration file names; without a file, none.

    Raises:
        UserError: a file is invalid.
    """
    path = request.app[CONTROL].path
    if path is None:
        return PresentCalibration(request.app[SERVICE].config.camera_ids)
    return await asyncio.to_thread(present_calibration, path)


def picture_sizes(request: web.Request) -> dict[str, tuple[int, int]]:
    """Return the sizes of cameras' own pictures, as far as they are known."""
    cameras = request.app[SERVICE].cameras.diagnose_cameras()
    return {
        camera.camera: (camera.picture.width, camera.picture.height)
        for camera in cameras
        if camera.picture is not None
    }


def _status(present: PresentCalibration, result: PointsResult | None = None) -> MarkedPointsStatus:
    homographies = {camera: matrix.tolist() for camera, matrix in present.ground.homographies.items()}
    return MarkedPointsStatus(present.ground.unit, dict(present.points), homographies, present.digest, result)


async def _result(calibration: PointCalibration) -> PointsResult:
    report = calibration.report
    errors = {
        camera: [
            PointError(floor, image)
            for floor, image in zip(fit.floor_error.tolist(), fit.image_error.tolist(), strict=True)
        ]
        for camera, fit in report.fits.items()
    }
    return PointsResult(
        list(report.lines), errors, report.ground, "ground: ground.json\n", await draw_plan(calibration)
    )
