"""Signing in as the operator, and the operator's page."""

from __future__ import annotations

from typing import TypeVar

import msgspec
from aiohttp import web

from server.web.api import answer, problem
from server.web.operator_permission import PERMISSION, SESSION_S, SIGN_IN
from server.web.operator_schema import OperatorSession
from server.web.page import page_file
from server.wire.messages import UNREADABLE

routes = web.RouteTableDef()

Asked = TypeVar("Asked")


class SignIn(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the sign-in form sends."""

    token: str


@routes.get("/operator")
async def get_operator_page(request: web.Request) -> web.StreamResponse:
    """Give the operator's page; what it shows, it has to ask for."""
    del request
    response = page_file("operator.html")
    policy = response.headers["Content-Security-Policy"]
    response.headers["Content-Security-Policy"] = f"{policy}; frame-ancestors 'none'"  # no click is led here
    return response


@routes.get(SIGN_IN)
async def get_session(request: web.Request) -> web.Response:
    """Say that this is the operator, and whether by a token."""
    return answer(OperatorSession(by_token=request.app[PERMISSION].by_token))


@routes.post(SIGN_IN)
async def post_session(request: web.Request) -> web.StreamResponse:
    """Sign in: a token for a cookie."""
    permission = request.app[PERMISSION]
    if not permission.by_token:
        return problem(400, "no token is configured: there is nothing to sign in to")
    asked = await asked_for(request, SignIn)
    refused = permission.token_refusal(request, asked.token.strip())
    if refused is not None:
        return refused
    response = answer(OperatorSession(by_token=True))
    encrypted = "https" in (request.scheme, request.headers.get("X-Forwarded-Proto"))
    response.set_cookie(
        permission.cookie,
        permission.open_session(),
        max_age=SESSION_S,
        httponly=True,
        samesite="Strict",
        secure=encrypted,
    )
    return response


@routes.delete(SIGN_IN)
async def delete_session(request: web.Request) -> web.Response:
    """Sign out."""
    permission = request.app[PERMISSION]
    permission.close_session(request)
    response = answer(OperatorSession(by_token=permission.by_token))
    response.del_cookie(permission.cookie, samesite="Strict", httponly=True)
    return response


async def asked_for(request: web.Request, kind: type[Asked]) -> Asked:
    """Read what a request asks for.

    Raises:
        HTTPBadRequest: it is not JSON of that kind.
    """
    try:
        return msgspec.json.decode(await request.read(), type=kind)
    except UNREADABLE as error:
        raise web.HTTPBadRequest(reason=f"the request's JSON: {' '.join(str(error).split())}") from error
