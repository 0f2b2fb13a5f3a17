"""Pages of other origins may read everything: nothing here is given for a secret that a browser keeps."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from aiohttp import web

_DAY_S = 86_400


@web.middleware
async def preflight(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer OPTIONS of whatever there is: what a page of another origin may ask for (Fetch, 3.2.2)."""
    try:
        return await handler(request)
    except web.HTTPMethodNotAllowed as error:
        if request.method != "OPTIONS":
            raise
        methods = ", ".join(sorted({*error.allowed_methods, "OPTIONS"}))
        headers = {
            "Allow": methods,
            "Access-Control-Allow-Origin": "*",
            "Access-Control-Allow-Methods": methods,
            "Access-Control-Allow-Headers": "*",
            "Access-Control-Max-Age": str(_DAY_S),
        }
        return web.Response(status=204, headers=headers)
