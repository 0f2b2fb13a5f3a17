"""Sharding: redirects requests for a person to the best-view service of that person."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable

from aiohttp import web

from server.http.app_keys import SERVICE
from server.http.json_responses import error_response

_OBJECT_PATH = re.compile(r"/(?:api/)?objects/([0-9]{1,9})/")


@web.middleware
async def redirect_to_shard(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer 307 with the other service's URL; 404 if view.share.servers does not name it."""
    path = _OBJECT_PATH.match(request.path)
    if path is None:
        return await handler(request)
    number = int(path[1])
    shard = request.app[SERVICE].people.shard_of(number)
    if shard.is_own:
        return await handler(request)
    if shard.server is None:
        return error_response(
            404,
            f"object {number} is served by best-view service {shard.index} of this site; "
            "view.share.servers does not have its URL",
        )
    headers = {"Location": shard.server + request.path_qs.lstrip("/"), "Access-Control-Allow-Origin": "*"}
    return web.Response(status=307, headers=headers)
