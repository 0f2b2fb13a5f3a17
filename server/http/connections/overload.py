"""Overload: when all connections are busy, only operators and public routes are answered."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from aiohttp import web

from server.http.access.authorization import ACCESS
from server.http.access.csrf import route_pattern
from server.http.access.permissions import Permission, permission_for
from server.http.connections.listener import PooledHandler
from server.http.json_responses import unavailable


@web.middleware
async def guard_reserved_connections(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Mark the connection as busy; on a reserved one answer only operators and public routes, then close it.

    Public routes include the page's files, signing in and health checks: without them no operator could sign
    in.
    """
    protocol = request.protocol
    if not isinstance(protocol, PooledHandler):
        return await handler(request)
    protocol.pool.busy(protocol.connection)
    if not protocol.connection.is_reserved:
        return await handler(request)
    permission = permission_for(request.method, route_pattern(request))
    if permission is Permission.PUBLIC or request.app[ACCESS].authenticates_as_operator(request):
        response = await handler(request)
    else:
        response = unavailable("all connections of this server (http.connections_max) are busy")
    response.force_close()
    return response
