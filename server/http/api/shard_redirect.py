"""Redirects requests for a person: to the best-view service of that person, or to the site that sees them."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable

from aiohttp import web

from server.http.access.authorization import ACCESS
from server.http.app_keys import SERVICE
from server.http.json_responses import error_response
from server.service.facade.sites import PersonAtSite

_LIVE = {
    *(f"/objects/{{object}}/best.{form}" for form in ("mp4", "ts", "webm", "mjpeg", "jpg")),
    "/objects/{object}/hls/index.m3u8",
    "/objects/{object}/whep",
    "/api/objects/{object}/choice",
}
"""Routes that lead to another site where that has seen the person last. Recordings, HLS segments and
thumbnails are of this one."""
_PAST = {"from", "to", "at"}
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
        there = _at_other_site(request, number)
        return await handler(request) if there is None else _redirect(there.url, request, there.knows_token)
    if shard.server is None:
        return error_response(
            404,
            f"object {number} is served by best-view service {shard.index} of this site; "
            "view.share.servers does not have its URL",
        )
    return _redirect(shard.server, request, with_token=True)


def _at_other_site(request: web.Request, number: int) -> PersonAtSite | None:
    """Return where a person is whose live pictures are requested; None: here, or the sender may not know."""
    resource = request.match_info.route.resource
    if resource is None or resource.canonical not in _LIVE or request.query.keys() & _PAST:
        return None
    service = request.app[SERVICE]
    return service.sites.find(service.people.current_number(number), request.app[ACCESS].token_of(request))


def _redirect(server: str, request: web.Request, with_token: bool) -> web.Response:
    """Answer 307; without the token in the query unless the server is to have it."""
    url = request.rel_url if with_token else request.rel_url.without_query_params("token")
    headers = {"Location": server + str(url).lstrip("/"), "Access-Control-Allow-Origin": "*"}
    return web.Response(status=307, headers=headers)
