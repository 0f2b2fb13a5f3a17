"""Who may watch and operate: asked of every request, in one place, before anything else looks at it.

Without a file of tokens whoever reaches the server may watch, and this machine may operate. With one, every
address that has anything of the site in it needs a token: as ``Authorization: Bearer``, as ``?token=``, or by
a sign-in, which is a cookie. What a token that has just been taken away holds open is ended.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections import OrderedDict
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from aiohttp import web

from server.config.tokens_file import Token, token_digest
from server.http.access.csrf import path_of, refused_to_other_sites
from server.http.access.grants import Grant, Need, ShareHolder, need_of
from server.http.access.local_requests import is_from_here
from server.http.access.login_failures import Failures
from server.http.access.networks import network_of
from server.http.access.sessions import Sessions
from server.http.access.token_file import TokenFile
from server.http.api.handlers import problem
from server.http.periodic import again_and_again

COOKIE = "myview"
"""What the cookie's name begins with."""
HOW = (
    "operating is possible from the server's own machine, at http://127.0.0.1; to operate from elsewhere, "
    "`myview token NAME --operate` prints a token and the line for the file that access.tokens names"
)
_LOOK_EVERY_S = 0.5
_AS_SEEN_THEN = (Need.TOKEN, Need.OBJECT)
"""Of these, what is sent is what a token could see when it was asked for."""
_RIGHT = 4096
"""Tokens that were right, with the address they came from: they do not wait for others' wrong ones."""

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


@dataclass(frozen=True, slots=True)
class Holder:
    """By what somebody comes: the SHA-256 of a token, and of a sign-in's identifier where it is one."""

    token: str
    session: str | None = None


@dataclass(frozen=True, slots=True)
class _Asking:
    """A request that is being answered."""

    request: web.Request
    need: Need
    holder: Holder
    grant: Grant


class Access:
    """Says who may what.

    ``resolve`` gives the number that a merged one goes by now; ``what`` names the service among those of its
    machine; ``since`` is when people's numbers began, unix seconds.
    """

    def __init__(
        self,
        tokens: Path | None,
        resolve: Callable[[int], int],
        what: str = "site",
        now: Callable[[], float] = time.monotonic,
        since: Callable[[], float] = lambda: 0.0,
    ) -> None:
        """Read the file of tokens.

        Raises:
            UserError: it cannot be read, or something in it is wrong.
        """
        self.cookie = f"{COOKIE}_{what}"
        """Each has its own: all ports of a machine are one to a cookie (RFC 6265, 8.5)."""
        self.sessions = Sessions(now)
        self._file = None if tokens is None else TokenFile(tokens)
        self._resolve = resolve
        self._since = since
        self._failures = Failures(now)
        self._right: OrderedDict[tuple[str, str], None] = OrderedDict()
        self._asking: dict[int, _Asking] = {}
        self._reader = ThreadPoolExecutor(1, "tokens")
        self.wrong_tokens = 0
        """Since the start. They are counted and not logged: strangers could fill a disk with that."""

    @property
    def by_token(self) -> bool:
        """Whether tokens are needed."""
        return self._file is not None

    def grant(self, request: web.Request) -> Grant:
        """Give what whoever asks may, while the request is being answered."""
        asking = self._asking.get(id(request))
        return Grant(operates=is_from_here(request)) if asking is None else asking.grant

    def share_holder(self, request: web.Request) -> ShareHolder:
        """Return in whose name somebody comes, while the request is being answered."""
        asking = self._asking.get(id(request))
        if asking is not None:
            return ShareHolder(f"token {asking.holder.token}", asking.grant.operates)
        if is_from_here(request):
            return ShareHolder("this machine", operates=True)
        return ShareHolder(network_of(request.remote or ""))

    def operates(self, request: web.Request) -> bool:
        """Tell whether whoever asks may operate, before anything is answered."""
        if self._file is None:
            return is_from_here(request)
        holder = self._holder(request)
        held = self.held(holder) if isinstance(holder, Holder) else None
        return isinstance(held, Grant) and held.operates

    async def answer(self, request: web.Request, need: Need, handler: Handler) -> web.StreamResponse:
        """Answer a request, if whoever asks may have the answer."""
        if self._file is None:
            grant = Grant(operates=is_from_here(request))
            allowed = grant.allows(need, request, self._resolve)
            return await handler(request) if allowed else problem(403, HOW)
        holder = self._holder(request)
        if isinstance(holder, web.Response):
            return holder
        held = None if holder is None else self.held(holder)
        if holder is None or held is None:
            return _unknown(need)
        if isinstance(held, str):
            return problem(403, held)
        if not held.allows(need, request, self._resolve):
            return problem(403, f"the token {held.name!r} is for {held}, and for nothing else")
        self._asking[id(request)] = _Asking(request, need, holder, held)
        try:
            return await handler(request)
        finally:
            del self._asking[id(request)]

    def known(self, request: web.Request, given: str) -> Holder | web.Response:
        """Look a token up that somebody gives; where it is none, say so, and after some have them wait."""
        digest, address = token_digest(given), request.remote or "?"
        wait = 0.0 if (address, digest) in self._right else self._failures.wait(address)
        if wait > 0:
            seconds = math.ceil(wait)  # not too soon by a fraction
            answer = problem(429, f"too many wrong tokens; try again in {seconds} s")
            answer.headers["Retry-After"] = str(seconds)
            return answer
        if self._file is not None and self._file.find(digest) is not None:
            self._right[address, digest] = None
            self._right.move_to_end((address, digest))
            if len(self._right) > _RIGHT:
                self._right.popitem(last=False)
            return Holder(digest)
        self._right.pop((address, digest), None)
        self._failures.add(address)
        self.wrong_tokens += 1
        return _challenged("there is no such token, or not any more")

    def session_of(self, request: web.Request) -> str:
        """Give the SHA-256 of the identifier in a request's cookie."""
        return token_digest(request.cookies.get(self.cookie, ""))

    async def run(self) -> None:
        """Look at the file again and again, and end what nobody may have any more."""
        if self._file is None:
            return
        try:
            async with asyncio.TaskGroup() as both:  # sign-ins end by themselves, however long the disk takes
                both.create_task(again_and_again(_LOOK_EVERY_S, self._look, "looking at the file of tokens"))
                both.create_task(again_and_again(_LOOK_EVERY_S, self._end, "ending what is over"))
        finally:
            self._reader.shutdown(wait=False)

    async def _end(self) -> None:
        self.end_what_is_over()

    async def _look(self) -> None:
        assert self._file is not None  # noqa: S101 — nobody looks where there is none
        try:
            # A long file takes longer to read than a frame. The thread is its own: all others may wait for
            # some other disk.
            await asyncio.get_running_loop().run_in_executor(self._reader, self._file.look)
        finally:
            self.end_what_is_over()

    def end_what_is_over(self) -> None:
        """End all answers whose token or sign-in is not in force any more."""
        for it in list(self._asking.values()):
            held = self.held(it.holder)
            if (
                isinstance(held, Grant)
                and held.allows(it.need, it.request, self._resolve)
                and (it.need not in _AS_SEEN_THEN or held == it.grant)
            ):
                continue
            if it.request.transport is not None:
                it.request.transport.abort()

    def _holder(self, request: web.Request) -> Holder | web.Response | None:
        """Give by what somebody comes; a token that they name goes before a sign-in."""
        kind, _, bearer = request.headers.get("Authorization", "").partition(" ")
        given = bearer.strip() if kind.lower() == "bearer" else request.query.get("token")
        if given is not None:
            return self.known(request, given)
        session = self.session_of(request)
        token = self.sessions.token(session)
        return None if token is None else Holder(token, session)

    def held(self, holder: Holder) -> Grant | str | None:
        """Give what somebody may now; None: it is not in force any more; or say why it is void."""
        if holder.session is not None and self.sessions.token(holder.session) is None:
            return None
        token = None if self._file is None else self._file.still(holder.token)
        if token is None:
            return None
        return self._void(token) or Grant.of(token)

    def _void(self, token: Token) -> str | None:
        if token.object is None or token.made is None or token.made.timestamp() >= self._since():
            return None
        return (
            f"people have been numbered anew since the token {token.name!r} was made, and object "
            f"{token.object} may be somebody else now: make a new one"
        )


ACCESS = web.AppKey("access", Access)


def sees_one_person(request: web.Request) -> bool:
    """Tell whether whoever asks may see one person alone: what they watch is of that person, or grey."""
    return request.app[ACCESS].grant(request).sees.object is not None


def _unknown(need: Need) -> web.Response:
    if need is Need.OPERATOR:
        return _challenged("operating needs an operator's token; sign in at /operator")
    return _challenged("watching needs a token; sign in at /, or send it (docs/how-to/secure.md)")


def _challenged(why: str) -> web.Response:
    """Refuse, and say by what it would not be (RFC 9110, 15.5.2)."""
    answer = problem(401, why)
    answer.headers["WWW-Authenticate"] = "Bearer"
    return answer


@web.middleware
async def only_who_may(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Let nobody have an answer who may not."""
    refused = refused_to_other_sites(request)
    if refused is not None:
        return refused
    if request.match_info.route.resource is None:
        return await handler(request)  # there is nothing, or not by this method
    need = need_of(request.method, path_of(request))
    if need is None:
        return problem(403, "nobody may: it is not decided who may")
    if need is Need.NOTHING:
        return await handler(request)
    return await request.app[ACCESS].answer(request, need, handler)


async def keep_no_copies(request: web.Request, response: web.StreamResponse) -> None:
    """Forbid caches on the way to keep an answer for others, where it takes a token to have it."""
    kept = response.headers.get("Cache-Control", "")
    if kept.startswith("public") and request.app[ACCESS].by_token:
        response.headers["Cache-Control"] = kept.replace("public", "private", 1)
