"""``/api/session``: signing in exchanges a token for a session cookie, which no script can read."""

from __future__ import annotations

import msgspec
from aiohttp import web

from server.http.access.authorization import ACCESS, AccessControl
from server.http.access.permissions import SESSION_PATH, Grant
from server.http.access.sessions import SESSION_LIFETIME_S
from server.http.json_requests import json_body
from server.http.json_responses import error_response, json_response

routes = web.RouteTableDef()


class SessionInfo(msgspec.Struct, frozen=True):
    """Permissions of the caller."""

    by_token: bool
    """Whether tokens are configured; otherwise everyone may watch, and the server's machine may operate."""
    name: str | None
    """The token's name; null without tokens."""
    role: str
    """watch or operate."""
    object: int | None
    """Limited to this person; null: not limited."""
    camera: str | None
    """Limited to this camera; null: not limited."""


class SignIn(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The body of a sign-in request."""

    token: str


@routes.get(SESSION_PATH)
async def get_session(request: web.Request) -> web.Response:
    """Return the permissions of the request."""
    access = request.app[ACCESS]
    return json_response(_session_info(access, access.grant(request)))


@routes.post(SESSION_PATH)
@json_body(SignIn)
async def post_session(request: web.Request, sign_in: SignIn) -> web.StreamResponse:
    """Sign in."""
    access = request.app[ACCESS]
    authenticator = access.authenticator
    if not access.needs_token:
        return error_response(400, "there are no tokens (access.tokens), so signing in is not needed")
    credential = authenticator.check_token(request, sign_in.token.strip())
    if isinstance(credential, web.Response):
        return credential
    grant = authenticator.grant_of(credential)
    if not isinstance(grant, Grant):
        return error_response(403, grant or "the token was revoked")
    authenticator.sessions.close(authenticator.session_digest_of(request))
    response = json_response(_session_info(access, grant))
    encrypted = "https" in (request.scheme, request.headers.get("X-Forwarded-Proto"))
    response.set_cookie(
        authenticator.cookie,
        authenticator.sessions.open(credential.token_digest),
        max_age=SESSION_LIFETIME_S,
        httponly=True,
        samesite="Strict",
        secure=encrypted,
    )
    return response


@routes.delete(SESSION_PATH)
async def delete_session(request: web.Request) -> web.Response:
    """Sign out, and end the session's open streams."""
    access = request.app[ACCESS]
    authenticator = access.authenticator
    authenticator.sessions.close(authenticator.session_digest_of(request))
    access.end_expired()
    response = web.Response(status=204)
    response.del_cookie(authenticator.cookie, samesite="Strict", httponly=True)
    return response


def _session_info(access: AccessControl, grant: Grant) -> SessionInfo:
    return SessionInfo(
        by_token=access.needs_token,
        name=grant.name,
        role="operate" if grant.is_operator else "watch",
        object=grant.scope.object,
        camera=grant.scope.camera,
    )
