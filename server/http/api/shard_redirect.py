"""Redirects requests for a person or a camera to the best-view service that has them, or to another site."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable

from aiohttp import web

from server.http.access.authorization import ACCESS
from server.http.app_keys import SERVICE
from server.http.json_responses import error_response
from server.service.facade.people import PersonElsewhere

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
_CAMERA_PATH = re.compile(r"/(?:api/)?cameras/([^/]+)/")


@web.middleware
async def redirect_to_shard(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer 307 with the other service's URL; 404 if view.sharding.servers does not name it."""
    path = _OBJECT_PATH.match(request.path)
    if path is None:
        camera = _CAMERA_PATH.match(request.path)
        server = None if camera is None else request.app[SERVICE].cameras.server_of(camera[1])
        return await handler(request) if server is None else _redirect(server, request, with_token=True)
    number = request.app[SERVICE].people.current_number(int(path[1]))
    shard = request.app[SERVICE].people.shard_of(number)
    if not shard.is_own and shard.has_past and not _is_live(request):
        return await handler(request)  # of when the person was here
    if shard.is_own:
        there = _at_other_site(request, number)
        if there is None or there.server is None:
            return await handler(request)
        return _redirect(there.server, request, there.token, number)
    if shard.server is None:
        return error_response(
            404,
            f"object {number} is served by best-view service {shard.index} of this site; "
            "view.sharding.servers does not have its URL",
        )
    return _redirect(shard.server, request, with_token=True, number=number)


def _at_other_site(request: web.Request, number: int) -> PersonElsewhere | None:
    """Return where a person is whose live pictures are requested; None: here, or the sender may not know."""
    if not _is_live(request):
        return None
    service = request.app[SERVICE]
    return service.sites.find(number, request.app[ACCESS].token_of(request))


def _is_live(request: web.Request) -> bool:
    resource = request.match_info.route.resource
    return resource is not None and resource.canonical in _LIVE and not request.query.keys() & _PAST


def _redirect(server: str, request: web.Request, with_token: bool, number: int | None = None) -> web.Response:
    """Answer 307; without the token in the query unless the server is to have it.

    ``number`` replaces the person's: the other service does not know whom an operator has merged here.
    """
    url = request.rel_url if with_token else request.rel_url.without_query_params("token")
    path = str(url)
    if number is not None:
        path = _OBJECT_PATH.sub(lambda old: old[0].replace(old[1], str(number)), path, count=1)
    headers = {"Location": server + path.lstrip("/"), "Access-Control-Allow-Origin": "*"}
    return web.Response(status=307, headers=headers)
