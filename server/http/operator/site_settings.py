"""``/api/operator/site_settings``: the site's name, rate and size in the configuration file, as in set-up."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path

from aiohttp import web

from server.http.access.permissions import OPERATOR_PATH
from server.http.json_requests import json_body
from server.http.json_responses import error_response, json_response
from server.http.operator.config_file import change_config, config_path
from server.http.operator.marked_points import picture_sizes
from server.http.operator.schema import SiteFormat
from server.http.operator.setup import SiteChoice
from server.setup.site_settings import StreamFormatChoice, read_choice, save_choice
from server.system.errors import UserError

routes = web.RouteTableDef()

_PATH = f"{OPERATOR_PATH}/site_settings"


class SiteChange(SiteChoice, frozen=True, forbid_unknown_fields=True):
    """New settings of the site."""

    digest: str | None = None
    """Of the settings that this change is based on; null: it is made whatever they are."""


@routes.get(_PATH)
async def get_site_settings(request: web.Request) -> web.Response:
    """Return the site's name, rate and size in the configuration file."""
    return await _answer(request, None)


@routes.put(_PATH)
@json_body(SiteChange)
async def put_site_settings(request: web.Request, wanted: SiteChange) -> web.Response:
    """Change the site's name, rate and size in the configuration file; a restart brings them into force."""
    choice = StreamFormatChoice(wanted.name, wanted.fps, wanted.width, wanted.height)
    pictures = picture_sizes(request)
    return await _answer(
        request, partial(save_choice, choice=choice, digest=wanted.digest, pictures=pictures)
    )


async def _answer(request: web.Request, change: Callable[[Path], None] | None) -> web.Response:
    try:
        path = config_path(request)
        if change is not None:
            await change_config(path, change)
        now = await asyncio.to_thread(read_choice, path)
    except UserError as error:
        return error_response(409, str(error))
    return json_response(SiteFormat(now.name, now.fps, now.width, now.height, now.digest))
