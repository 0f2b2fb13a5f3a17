"""Whoever asks one of several best-view services for another's person is sent there."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable

from aiohttp import web

from server.http.api.handlers import problem
from server.http.app_keys import SERVICE
from server.service.identity.sharding import shard_address, shard_of

_ABOUT_SOMEBODY = re.compile(r"/(?:api/)?objects/([0-9]{1,9})/")


@web.middleware
async def to_the_right_service(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer 307 with the other's address; 404 where the configuration does not say it."""
    share = request.app[SERVICE].config.view.share
    about = _ABOUT_SOMEBODY.match(request.path)
    if about is None or shard_of(int(about[1]), share) == share.index:
        return await handler(request)
    number = int(about[1])
    server = shard_address(number, share)
    if server is None:
        return problem(
            404,
            f"object {number} is served by best-view service {shard_of(number, share)} of this site; "
            "view.share.servers does not say where that is",
        )
    headers = {"Location": server + request.path_qs.lstrip("/"), "Access-Control-Allow-Origin": "*"}
    return web.Response(status=307, headers=headers)
