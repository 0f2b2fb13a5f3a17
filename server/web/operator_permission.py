"""Who may operate the site: whoever sits at this machine or, where a token is configured, whoever has it.

Whether somebody may is asked in one place, :class:`Permission`; every address below ``/api/operator/`` goes
by it. What changes anything needs the head ``X-MyView-Operator`` besides, which a page of another site cannot
send: browsers ask beforehand (Fetch, 3.2.2), and are not answered.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import math
import secrets
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

from aiohttp import HttpVersion11, web
from yarl import URL

from server.web.api import problem

PREFIX = "/api/operator"
COOKIE = "myview_operator"
"""What the cookie's name begins with."""
SIGN_IN = f"{PREFIX}/session"
CHANGES = "X-MyView-Operator"
"""The head of a request that changes something."""

SESSION_S = 12 * 3600
"""Seconds that a sign-in lasts."""
_SESSIONS = 64
_FAILURES = 5
"""Wrong tokens that one address may send before it has to wait."""
_FORGIVEN_S = 12.0
"""Seconds after which one of them is forgotten."""
_ADDRESSES = 1024
_PROXIES = ("Forwarded", "Via", "X-Forwarded-For", "X-Forwarded-Host", "X-Real-IP")

HOW = (
    "operating is possible from the server's own machine, at http://127.0.0.1; to operate from elsewhere, "
    "`myview operator-token` prints a token and the line http.operator_token for the configuration"
)

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


def digest_of(token: str) -> str:
    """Give what the configuration knows of a token: its SHA-256, in hex."""
    return hashlib.sha256(token.encode(errors="surrogatepass")).hexdigest()  # heads may hold any bytes


@dataclass(slots=True)
class Failures:
    """Wrong tokens by address: so many at once, then one every few seconds."""

    now: Callable[[], float]
    _until: dict[str, float] = field(default_factory=dict)
    """When all of an address's failures are forgotten."""

    def wait(self, address: str) -> float:
        """Give the seconds that an address has to wait before its next try; 0: none."""
        return max(0.0, self._until.get(address, 0.0) - self.now() - (_FAILURES - 1) * _FORGIVEN_S)

    def add(self, address: str) -> None:
        """Note a failure."""
        now = self.now()
        self._until = {it: until for it, until in self._until.items() if until > now}
        if len(self._until) >= _ADDRESSES:
            del self._until[min(self._until, key=self._until.__getitem__)]
        self._until[address] = max(now, self._until.get(address, 0.0)) + _FORGIVEN_S


class Permission:
    """Says who may operate what; ``digest`` is the token's SHA-256 in hex, None: only this machine may."""

    def __init__(
        self, digest: str | None, now: Callable[[], float] = time.monotonic, what: str = "site"
    ) -> None:
        self.cookie = f"{COOKIE}_{what}"
        """Each has its own: all ports of a machine are one to a cookie (RFC 6265, 8.5)."""
        self._digest = digest
        self._now = now
        self._failures = Failures(now)
        self._sessions: dict[str, float] = {}
        """When each ends, by its identifier's SHA-256: comparing those tells nothing of the identifier."""

    @property
    def by_token(self) -> bool:
        """Whether a token is needed."""
        return self._digest is not None

    def refusal(self, request: web.Request) -> web.Response | None:
        """Say why a request may not operate; None: it may."""
        if self._digest is None:
            return None if _from_here(request) else problem(403, HOW)
        if self._ends(request.cookies.get(self.cookie, "")) is not None:
            return None
        kind, _, token = request.headers.get("Authorization", "").partition(" ")
        if kind.lower() == "bearer":
            return self.token_refusal(request, token.strip())
        answer = problem(401, "operating needs the operator's token; sign in at /operator")
        answer.headers["WWW-Authenticate"] = "Bearer"
        return answer

    def token_refusal(self, request: web.Request, token: str) -> web.Response | None:
        """Say why a token is not taken; None: it is the operator's."""
        address = request.remote or "?"
        wait = self._failures.wait(address)
        if wait > 0:
            seconds = math.ceil(wait)  # not too soon by a fraction
            answer = problem(429, f"too many wrong tokens; try again in {seconds} s")
            answer.headers["Retry-After"] = str(seconds)
            return answer
        if self._digest is not None and hmac.compare_digest(digest_of(token), self._digest):
            return None
        self._failures.add(address)
        return problem(401, "that is not the operator's token")

    def open_session(self) -> str:
        """Give a new session's identifier, for a cookie."""
        now = self._now()
        self._sessions = {it: ends for it, ends in self._sessions.items() if ends > now}
        if len(self._sessions) >= _SESSIONS:
            del self._sessions[min(self._sessions, key=self._sessions.__getitem__)]
        session = secrets.token_urlsafe(32)
        self._sessions[digest_of(session)] = now + SESSION_S
        return session

    def close_session(self, request: web.Request) -> None:
        """End the session of a request."""
        self._sessions.pop(digest_of(request.cookies.get(self.cookie, "")), None)

    def _ends(self, session: str) -> float | None:
        ends = self._sessions.get(digest_of(session))
        return ends if ends is not None and ends > self._now() else None


PERMISSION = web.AppKey("permission", Permission)


@web.middleware
async def operators_only(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Let nobody else to the operator's addresses."""
    path = _path(request)
    return (_refused(request, path) if _is_theirs(path) else None) or await handler(request)


async def tell_no_other_origin(request: web.Request, response: web.StreamResponse) -> None:
    """Take back that pages of other origins may read an answer, before any of it is sent."""
    if _is_theirs(_path(request)):
        response.headers.popall("Access-Control-Allow-Origin", None)


def _path(request: web.Request) -> str:
    resource = request.match_info.route.resource
    return request.path if resource is None else resource.canonical


def _is_theirs(path: str) -> bool:
    return path == PREFIX or path.startswith(f"{PREFIX}/")


def _refused(request: web.Request, path: str) -> web.Response | None:
    if request.method == "OPTIONS":
        return problem(403, "the operator's addresses answer no page of another origin")
    if request.headers.get("Sec-Fetch-Site", "none") not in {"none", "same-origin"}:
        return problem(403, "operating is not possible from another site's page")
    if request.method not in {"GET", "HEAD"} and CHANGES not in request.headers:
        return problem(
            403, f"{request.method} needs the head {CHANGES}: 1, which other sites' pages cannot send"
        )
    if path == SIGN_IN and request.method in {"POST", "DELETE"}:
        return None
    return request.app[PERMISSION].refusal(request)


def _from_here(request: web.Request) -> bool:
    """Tell whether a request comes from this machine: by its address, by no proxy, and by a name of it.

    The name is looked at since a page's own name can be made to lead here (DNS rebinding).
    """
    if request.version < HttpVersion11 or any(it in request.headers for it in _PROXIES):
        return False  # HTTP/1.0 is what some proxies speak; no browser does
    named = [f"http://{request.host}"]
    named += [request.headers[it] for it in ("Origin", "Referer") if it in request.headers]
    return _is_loopback(request.remote or "") and all(_names_this_machine(it) for it in named)


def _names_this_machine(address: str) -> bool:
    try:
        host = URL(address).host or ""
    except ValueError:
        return False
    return host == "localhost" or _is_loopback(host)


def _is_loopback(address: str) -> bool:
    try:
        ip = ipaddress.ip_address(address)
    except ValueError:
        return False
    mapped = getattr(ip, "ipv4_mapped", None)
    return (mapped or ip).is_loopback
