"""Cross-origin requests: pages of other origins may read what is public or what they send a token for.

A session does not help them: its cookie is not sent from another site's page.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from aiohttp import web

_DAY_S = 86_400


@web.middleware
async def answer_preflight(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Answer OPTIONS of every route: what a page of another origin may request (Fetch, 3.2.2)."""
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
            "Access-Control-Allow-Headers": "*, Authorization",  # a star does not stand for that one
            "Access-Control-Max-Age": str(_DAY_S),
        }
        return web.Response(status=204, headers=headers)
