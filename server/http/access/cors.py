"""CORS: pages of other origins may read public answers, and others for which they send a token.

They cannot use a session: browsers do not send its cookie from another site's page.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from aiohttp import web

_DAY_S = 86_400


@web.middleware
async def answer_preflight(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer the CORS preflight (OPTIONS) of every route (Fetch, 3.2.2)."""
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
            "Access-Control-Allow-Headers": "*, Authorization",  # * does not include Authorization
            "Access-Control-Max-Age": str(_DAY_S),
        }
        return web.Response(status=204, headers=headers)
