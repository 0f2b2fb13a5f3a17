"""What is answered where all places are taken: operators, and what has nothing of the site in it."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from aiohttp import web

from server.http.access.access_control import ACCESS
from server.http.access.csrf import path_of
from server.http.access.grants import Need, need_of
from server.http.api.handlers import not_now
from server.http.connections.listener import Handler


@web.middleware
async def keep_places(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Let a connection keep its place while it is answered; beyond all places few are answered, and once.

    They are operators; and whoever asks for the page's files, to sign in, or whether the service is well: who
    operates is known after that.
    """
    protocol = request.protocol
    if not isinstance(protocol, Handler):
        return await handler(request)
    protocol.places.asks(protocol.connection)
    if not protocol.connection.beyond:
        return await handler(request)
    if need_of(request.method, path_of(request)) is Need.NOTHING or request.app[ACCESS].operates(request):
        response = await handler(request)
    else:
        response = not_now("as many connections as this server takes (http.connections_max) are busy")
    response.force_close()
    return response
