"""``/api/operator/site_cameras``: the cameras in the configuration file; a restart brings them into force."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.app_keys import SERVICE, SETUP
from server.http.json_requests import json_body
from server.http.json_responses import error_response, json_response
from server.http.operator.camera_search import CameraTrial, Name
from server.http.operator.config_file import change_config, config_path
from server.http.operator.schema import SiteCamera, SiteCameras
from server.http.operator.trials import follow
from server.setup.site_cameras import (
    add_camera,
    demands_own_video,
    list_cameras,
    readdress_camera,
    remove_camera,
    rename_camera,
)
from server.system.errors import UserError

routes = web.RouteTableDef()

_PATH = f"{OPERATOR_PATH}/site_cameras"


class CameraToAdd(CameraTrial, frozen=True, forbid_unknown_fields=True):
    """A camera to try, and to add if it sends pictures, or to give its address to a camera of the site."""

    camera: Name = ""
    """The camera that gets the address; empty: it is a new one."""
    digest: str | None = None
    """Of that camera, as this change is based on it; null: the change is made whatever it is."""


class CameraToRename(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A camera's id, and its new one."""

    camera: Name
    name: Name
    digest: str | None = None
    """As in CameraToAdd."""


class CameraToRemove(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A camera's id."""

    camera: Name
    digest: str | None = None
    """As in CameraToAdd."""


@routes.get(_PATH)
async def get_site_cameras(request: web.Request) -> web.Response:
    """Return the cameras in the configuration file."""
    return await _answer(request, lambda _: None)


@routes.post(_PATH)
@json_body(CameraToAdd)
async def post_site_camera(request: web.Request, wanted: CameraToAdd) -> web.Response:
    """Try a camera; if it sends pictures, add it to the file, or give another one its address."""
    return await follow(request, _try(request, wanted))


async def _try(request: web.Request, wanted: CameraToAdd) -> web.Response:
    try:
        path = config_path(request)
        is_passed = await asyncio.to_thread(demands_own_video, path, wanted.camera, wanted.digest)
    except UserError as error:
        return error_response(409, str(error))
    session = request.app[SETUP]
    passed_into = path if is_passed else None
    tried = await session.try_camera(wanted.addresses(session), wanted.name, passed_into)
    if wanted.camera:
        sizes = _known_sizes(request)
        return await _answer(
            request, lambda path: readdress_camera(path, wanted.camera, tried, sizes, wanted.digest)
        )
    return await _answer(request, lambda path: add_camera(path, tried))


@routes.put(_PATH)
@json_body(CameraToRename)
async def put_site_camera(request: web.Request, wanted: CameraToRename) -> web.Response:
    """Rename a camera in the configuration file."""
    return await _answer(request, lambda path: rename_camera(path, wanted.camera, wanted.name, wanted.digest))


@routes.delete(_PATH)
@json_body(CameraToRemove)
async def delete_site_camera(request: web.Request, wanted: CameraToRemove) -> web.Response:
    """Remove a camera from the configuration file."""
    return await _answer(request, lambda path: remove_camera(path, wanted.camera, wanted.digest))


async def _answer(request: web.Request, change: Callable[[Path], str | None]) -> web.Response:
    """Change the file, and return its cameras."""
    try:
        path = config_path(request)
        note = await change_config(path, change)
        listed = await asyncio.to_thread(list_cameras, path)
    except UserError as error:
        return error_response(409, str(error))
    cameras = [SiteCamera(camera.id, camera.address, camera.substream, camera.digest) for camera in listed]
    return json_response(SiteCameras(cameras, note or ""))


def _known_sizes(request: web.Request) -> dict[str, tuple[int, int]]:
    """Return the sizes of pictures by source: of cameras that send, of what was tried, of those that sent."""
    service = request.app[SERVICE]
    sent, sends = dict[str, tuple[int, int]](), dict[str, tuple[int, int]]()
    for camera in service.cameras.diagnose_cameras():
        if camera.picture is not None:
            known = sends if camera.state == "live" else sent
            known[service.config.camera(camera.camera).source] = camera.picture.width, camera.picture.height
    return {**sent, **request.app[SETUP].sizes, **sends}
