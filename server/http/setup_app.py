"""The set-up page: an HTTP application of its own, for the user of this machine, before there is a site.

The printed address has a one-time token, which a browser exchanges for a cookie. Only requests from this
machine are answered.
"""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Awaitable, Callable
from hmac import compare_digest

from aiohttp import web

from logthrottle import LogThrottle
from server.http import static_files
from server.http.access.csrf import check_csrf
from server.http.access.local_requests import is_local_request
from server.http.access.permissions import SESSION_PATH
from server.http.access.session_routes import SessionInfo, SignIn
from server.http.access.sessions import SESSION_LIFETIME_S
from server.http.app_keys import SETUP
from server.http.error_responses import FAILURES, answer_errors, note_begun
from server.http.json_requests import json_body
from server.http.json_responses import error_response, json_response
from server.http.operator import camera_search, setup, trials
from server.http.operator.trials import add_trials
from server.setup.session import SetupSession
from server.system.errors import UserError, reason_of

COOKIE = "myview_setup"
_BODY_MAX_BYTES = 65_536
_SENT_S = 1.0
"""Time for the last answer to reach the browser."""
_OPEN_PATHS = ("/", "/favicon.ico")
_ONLY_HERE = "a site is set up from its own machine, at http://127.0.0.1 (from elsewhere: ssh -L)"
_NEEDS_TOKEN = "open the address that `myview up` printed; its token is valid once"  # noqa: S105 — a text


class SetupAccess:
    """The one-time token and the cookie it was exchanged for."""

    def __init__(self) -> None:
        self.token = secrets.token_urlsafe(24)
        self._unused = True
        self._cookie = secrets.token_urlsafe(32)

    def redeem(self, token: str) -> str | None:
        """Exchange the token for the cookie's value; None: it is wrong, or was used."""
        if not (compare_digest(token.encode(), self.token.encode()) and self._unused):
            return None
        self._unused = False
        return self._cookie

    def permits(self, request: web.Request) -> bool:
        """Return whether a request has the cookie."""
        return compare_digest(request.cookies.get(COOKIE, "").encode(), self._cookie.encode())


_ACCESS = web.AppKey("setup access", SetupAccess)
_routes = web.RouteTableDef()
_Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


@_routes.get("/")
async def _get_page(request: web.Request) -> web.StreamResponse:
    del request
    return static_files.page_file("setup.html")


@_routes.get("/page/{file:.+}")
async def _get_file(request: web.Request) -> web.StreamResponse:
    return await static_files.get_file(request)


@_routes.get(SESSION_PATH)
async def _get_session(request: web.Request) -> web.StreamResponse:
    del request
    return json_response(_SESSION)


@_routes.post(SESSION_PATH)
@json_body(SignIn)
async def _post_session(request: web.Request, sign_in: SignIn) -> web.StreamResponse:
    cookie = request.app[_ACCESS].redeem(sign_in.token.strip())
    if cookie is None:
        return error_response(401, _NEEDS_TOKEN)
    response = json_response(_SESSION)
    response.set_cookie(COOKIE, cookie, max_age=SESSION_LIFETIME_S, httponly=True, samesite="Strict")
    return response


_SESSION = SessionInfo(by_token=True, name="setup", role="operate", object=None, camera=None)


@web.middleware
async def _guard(request: web.Request, handler: _Handler) -> web.StreamResponse:
    """Answer only this machine, no page of another site, and what needs it only with the cookie."""
    if not is_local_request(request):
        return error_response(403, _ONLY_HERE)
    refused = check_csrf(request)
    if refused is not None:
        return refused
    path = request.path
    is_open = path in _OPEN_PATHS or path.startswith("/page/")
    is_sign_in = path == SESSION_PATH and request.method == "POST"
    if not (is_open or is_sign_in or request.app[_ACCESS].permits(request)):
        return error_response(401, _NEEDS_TOKEN)
    return await handler(request)


def make_setup_app(session: SetupSession, access: SetupAccess) -> web.Application:
    """Build the application for one set-up."""
    app = web.Application(middlewares=[answer_errors, _guard], client_max_size=_BODY_MAX_BYTES)
    app[SETUP], app[_ACCESS], app[FAILURES] = session, access, LogThrottle()
    app.add_routes(_routes)
    add_trials(app)
    app.add_routes(camera_search.routes)
    app.add_routes(trials.routes)
    app.add_routes(setup.routes)
    app.on_response_prepare.append(note_begun)
    return app


async def serve_setup(session: SetupSession, port: int, announce: Callable[[str], None]) -> int:
    """Serve the set-up page on this machine until the configuration is written; return the port.

    ``announce`` gets the address with the token. Port 0: any free one.

    Raises:
        UserError: the port cannot be listened on.
    """
    access = SetupAccess()
    runner = web.AppRunner(make_setup_app(session, access), access_log=None, shutdown_timeout=_SENT_S)
    await runner.setup()
    try:
        site = web.TCPSite(runner, "127.0.0.1", port)
        try:
            await site.start()
        except OSError as error:
            reason = reason_of(error)
            raise UserError(f"http.port: cannot listen on 127.0.0.1:{port}: {reason}") from error
        bound = int(runner.addresses[0][1])
        announce(f"http://127.0.0.1:{bound}/#token={access.token}")
        await session.written.wait()
        await asyncio.sleep(_SENT_S)
        return bound
    finally:
        await runner.cleanup()
