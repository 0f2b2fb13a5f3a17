"""The operator's page, and reading what it asks for."""

from __future__ import annotations

from typing import TypeVar

import msgspec
from aiohttp import web

from server.web.page import page_file
from server.wire.messages import UNREADABLE

routes = web.RouteTableDef()

Asked = TypeVar("Asked")


@routes.get("/operator")
async def get_operator_page(request: web.Request) -> web.StreamResponse:
    """Give the operator's page; what it shows, it has to ask for."""
    del request
    return page_file("operator.html")


async def asked_for(request: web.Request, kind: type[Asked]) -> Asked:
    """Read what a request asks for.

    Raises:
        HTTPBadRequest: it is not JSON of that kind.
    """
    try:
        return msgspec.json.decode(await request.read(), type=kind)
    except UNREADABLE as error:
        raise web.HTTPBadRequest(reason=f"the request's JSON: {' '.join(str(error).split())}") from error
