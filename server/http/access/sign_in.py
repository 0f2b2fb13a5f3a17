"""Signing in: a token for a cookie, which no script can read."""

from __future__ import annotations

import msgspec
from aiohttp import web

from server.http.access.access_control import ACCESS, Access
from server.http.access.grants import SESSION, Grant
from server.http.access.sessions import SESSION_S
from server.http.api.handlers import answer, asked_for, problem
from server.http.api.schema import SessionInfo

routes = web.RouteTableDef()


class SignIn(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the sign-in form sends."""

    token: str


@routes.get(SESSION)
async def get_session(request: web.Request) -> web.Response:
    """Say what whoever asks may."""
    access = request.app[ACCESS]
    return answer(_told(access, access.grant(request)))


@routes.post(SESSION)
async def post_session(request: web.Request) -> web.StreamResponse:
    """Sign in."""
    access = request.app[ACCESS]
    if not access.by_token:
        return problem(400, "there are no tokens (access.tokens): there is nothing to sign in to")
    asked = await asked_for(request, SignIn)
    holder = access.known(request, asked.token.strip())
    if isinstance(holder, web.Response):
        return holder
    held = access.held(holder)
    if not isinstance(held, Grant):
        return problem(403, held or "there is no such token any more")
    access.sessions.close(access.session_of(request))
    response = answer(_told(access, held))
    encrypted = "https" in (request.scheme, request.headers.get("X-Forwarded-Proto"))
    response.set_cookie(
        access.cookie,
        access.sessions.open(holder.token),
        max_age=SESSION_S,
        httponly=True,
        samesite="Strict",
        secure=encrypted,
    )
    return response


@routes.delete(SESSION)
async def delete_session(request: web.Request) -> web.Response:
    """Sign out; what the sign-in holds open is ended."""
    access = request.app[ACCESS]
    access.sessions.close(access.session_of(request))
    access.end_what_is_over()
    response = web.Response(status=204)
    response.del_cookie(access.cookie, samesite="Strict", httponly=True)
    return response


def _told(access: Access, grant: Grant) -> SessionInfo:
    return SessionInfo(
        by_token=access.by_token,
        name=grant.name,
        role="operate" if grant.operates else "watch",
        object=grant.sees.object,
        camera=grant.sees.camera,
    )
