"""The operator's page."""

from __future__ import annotations

from aiohttp import web

from server.http.static_files import page_file

routes = web.RouteTableDef()


@routes.get("/operator")
async def get_operator_page(request: web.Request) -> web.StreamResponse:
    """Return the operator's page; its data is fetched separately."""
    del request
    return page_file("operator.html")
