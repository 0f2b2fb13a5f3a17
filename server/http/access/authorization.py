"""Authorization: one check, for every route, of what a request's token permits.

Without a token file everyone who reaches the server may watch, and only this machine may operate. With one,
every route that shows anything of the site needs a token. Open answers end when their token is revoked or
expires.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace

from aiohttp import web

from server.config.sections.access import Blur
from server.http.access.authentication import Authenticator, Credential, challenge
from server.http.access.blurring import refuse_unblurred
from server.http.access.csrf import check_csrf, route_pattern
from server.http.access.local_requests import is_local_request
from server.http.access.networks import network_of
from server.http.access.permissions import ClientIdentity, Grant, Permission, Scope, permission_for
from server.http.json_responses import error_response
from server.http.periodic import run_periodically

HOW_TO_OPERATE = (
    "operating is possible from the server's own machine, at http://127.0.0.1; to operate from elsewhere, "
    "`myview token NAME --operate` prints a token and the line for the file that access.tokens names"
)
_CHECK_EVERY_S = 0.5
_BOUND_TO_GRANT = (Permission.ANY_TOKEN, Permission.OBJECT)
"""The answers to these depend on the grant: they end when it changes, not only when it is revoked."""

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


@dataclass(frozen=True, slots=True)
class _OpenRequest:
    """A request that is being answered."""

    request: web.Request
    permission: Permission
    credential: Credential
    grant: Grant
    end: Callable[[], None] | None = None
    """Ends what goes on after its answer; None: the answer is broken off."""


class AccessControl:
    """Lets permitted requests through, and ends their answers when their credential becomes invalid.

    ``resolve`` returns the current number of a person whose number may have been merged. ``blur``: whom
    viewers on other machines see pixelated, where there are no tokens.
    """

    def __init__(
        self, authenticator: Authenticator, resolve: Callable[[int], int], blur: Blur | None = None
    ) -> None:
        self.authenticator, self._resolve, self._blur = authenticator, resolve, blur
        self._open_requests: dict[int, _OpenRequest] = {}
        self._followed: dict[object, _OpenRequest] = {}
        self._file_reader = ThreadPoolExecutor(1, "tokens")

    @property
    def needs_token(self) -> bool:
        """Whether there is a token file."""
        return self.authenticator.file is not None

    def grant(self, request: web.Request) -> Grant:
        """Return the grant of a request that is being answered."""
        opened = self._open_requests.get(id(request))
        return self._grant_without_token(request) if opened is None else opened.grant

    def _grant_without_token(self, request: web.Request) -> Grant:
        if is_local_request(request):
            return Grant(is_operator=True)
        return Grant(Scope(blur=self._blur))

    def token_of(self, request: web.Request) -> str | None:
        """Return the SHA-256 of the token of a request that is being answered; None: it has none."""
        opened = self._open_requests.get(id(request))
        return None if opened is None else opened.credential.token_digest

    def client_of(self, request: web.Request) -> ClientIdentity:
        """Return the client whose share of slots a request that is being answered counts towards."""
        opened = self._open_requests.get(id(request))
        if opened is not None:
            return ClientIdentity(f"token {opened.credential.token_digest}", opened.grant.is_operator)
        if is_local_request(request):
            return ClientIdentity("this machine", is_operator=True)
        return ClientIdentity(network_of(request.remote or ""))

    def authenticates_as_operator(self, request: web.Request) -> bool:
        """Authenticate a request that is not being answered yet: return whether an operator sent it.

        A wrong token counts towards the rate limit of its address.
        """
        if not self.needs_token:
            return is_local_request(request)
        credential = self.authenticator.credential_of(request)
        grant = self.authenticator.grant_of(credential) if isinstance(credential, Credential) else None
        return isinstance(grant, Grant) and grant.is_operator

    async def answer(
        self, request: web.Request, permission: Permission, handler: Handler
    ) -> web.StreamResponse:
        """Answer a request if its credential grants the permission; otherwise return 401, 403 or 429."""
        if not self.needs_token:
            refused = self._refuse(request, permission, self._grant_without_token(request))
            return await handler(request) if refused is None else refused
        credential = self.authenticator.credential_of(request)
        if isinstance(credential, web.Response):
            return credential
        current = None if credential is None else self.authenticator.grant_of(credential)
        if credential is None or current is None:
            return _unauthenticated(permission)
        if isinstance(current, str):
            return error_response(403, current)
        if (refused := self._refuse(request, permission, current)) is not None:
            return refused
        self._open_requests[id(request)] = _OpenRequest(request, permission, credential, current)
        try:
            return await handler(request)
        finally:
            del self._open_requests[id(request)]

    def _refuse(self, request: web.Request, permission: Permission, grant: Grant) -> web.Response | None:
        """Return 403 for what a grant does not permit; None: it does."""
        if (refused := refuse_unblurred(request, permission, grant.scope)) is not None:
            return refused
        if grant.allows(permission, request, self._resolve):
            return None
        no_token = grant.name is None
        return error_response(
            403, HOW_TO_OPERATE if no_token else f"the token {grant.name!r} is only for {grant}"
        )

    def follow(self, request: web.Request) -> Callable[[Callable[[], None]], AbstractContextManager[None]]:
        """Return a context manager for what goes on after the answer to a request that is being answered.

        It is given a function, which is called when the request would not be permitted any more.
        """
        opened = self._open_requests.get(id(request))

        @contextmanager
        def following(end: Callable[[], None]) -> Iterator[None]:
            if opened is None:
                yield
                return
            key = object()
            self._followed[key] = replace(opened, end=end)
            try:
                yield
            finally:
                del self._followed[key]

        return following

    async def run(self) -> None:
        """Reload the token file when it changes, and end answers that are no longer permitted."""
        if not self.needs_token:
            return
        try:
            async with asyncio.TaskGroup() as tasks:  # two tasks: a slow disk must not delay expiry
                tasks.create_task(run_periodically(_CHECK_EVERY_S, self._reload, "reloading the token file"))
                tasks.create_task(run_periodically(_CHECK_EVERY_S, self._end, "ending expired requests"))
        finally:
            self._file_reader.shutdown(wait=False)

    def end_expired(self) -> None:
        """Break off all answers whose token or session is revoked or expired."""
        for opened in [*self._open_requests.values(), *self._followed.values()]:
            current = self.authenticator.grant_of(opened.credential)
            if (
                isinstance(current, Grant)
                and current.allows(opened.permission, opened.request, self._resolve)
                and current.scope.blur == opened.grant.scope.blur
                and (opened.permission not in _BOUND_TO_GRANT or current == opened.grant)
            ):
                continue
            if opened.end is not None:
                opened.end()
            elif opened.request.transport is not None:
                opened.request.transport.abort()

    async def _end(self) -> None:
        self.end_expired()

    async def _reload(self) -> None:
        assert self.authenticator.file is not None  # noqa: S101 — only called with a token file
        try:
            # A long file takes longer to read than a frame lasts. This thread reads nothing else: shared
            # threads may be blocked by another disk.
            reload = self.authenticator.file.reload_if_changed
            await asyncio.get_running_loop().run_in_executor(self._file_reader, reload)
        finally:
            self.end_expired()


ACCESS = web.AppKey("access", AccessControl)


def is_scoped_to_person(request: web.Request) -> bool:
    """Return whether a request may see one person only; frames without that person are blanked."""
    return request.app[ACCESS].grant(request).scope.object is not None


def _unauthenticated(permission: Permission) -> web.Response:
    if permission is Permission.OPERATE:
        return challenge("operating needs an operator's token; sign in at /operator")
    return challenge("watching needs a token; sign in at /, or send it (docs/how-to/secure.md)")


def blur_of(request: web.Request) -> Blur | None:
    """Return whom the viewer who sent a request sees pixelated; None: nobody."""
    return request.app[ACCESS].grant(request).scope.blur


@web.middleware
async def authorize(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Answer only requests whose credential permits it."""
    refused = check_csrf(request)
    if refused is not None:
        return refused
    if request.match_info.route.resource is None:
        return await handler(request)  # 404 or 405
    permission = permission_for(request.method, route_pattern(request))
    if permission is None:
        return error_response(403, "no access rule for this route")
    if permission is Permission.PUBLIC:
        return await handler(request)
    return await request.app[ACCESS].answer(request, permission, handler)


async def forbid_shared_caching(request: web.Request, response: web.StreamResponse) -> None:
    """Make cacheable answers private where a token is needed, so that no shared cache keeps them."""
    cache_control = response.headers.get("Cache-Control", "")
    if cache_control.startswith("public") and request.app[ACCESS].needs_token:
        response.headers["Cache-Control"] = cache_control.replace("public", "private", 1)
