"""``/api/operator/site_settings``: the site's name, rate and size in the configuration file, as in set-up."""

from __future__ import annotations

import asyncio
from functools import partial

import msgspec
from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.json_responses import error_response, json_response, read_json
from server.http.operator.config_file import change_config, config_path
from server.http.operator.schema import SiteFormat
from server.http.operator.setup import SiteChoice
from server.setup.site_settings import StreamFormatChoice, read_choice, save_choice
from server.system.errors import UserError

routes = web.RouteTableDef()

_PATH = f"{OPERATOR_PATH}/site_settings"


@routes.get(_PATH)
async def get_site_settings(request: web.Request) -> web.Response:
    """Return the site's name, rate and size in the configuration file."""
    return await _answer(request, None)


@routes.put(_PATH)
async def put_site_settings(request: web.Request) -> web.Response:
    """Change the site's name, rate and size in the configuration file; a restart brings them into force."""
    wanted = await read_json(request, SiteChoice)
    return await _answer(request, StreamFormatChoice(**msgspec.structs.asdict(wanted)))


async def _answer(request: web.Request, choice: StreamFormatChoice | None) -> web.Response:
    try:
        path = config_path(request)
        if choice is not None:
            await change_config(path, partial(save_choice, choice=choice))
        now = await asyncio.to_thread(read_choice, path)
    except UserError as error:
        return error_response(409, str(error))
    return json_response(SiteFormat(now.name, now.fps, now.width, now.height))
