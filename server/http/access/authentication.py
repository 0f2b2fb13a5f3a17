"""Authentication: which token or session a request comes with, and whether that is valid now.

A token arrives as ``Authorization: Bearer``, as ``?token=``, or by a session, which is a cookie. Unknown,
revoked and expired ones are refused here, and so are addresses that send too many wrong ones.
"""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from aiohttp import web

from server.config.tokens_file import Token, token_digest
from server.http.access.login_rate_limit import LoginRateLimit
from server.http.access.permissions import Grant
from server.http.access.sessions import Sessions
from server.http.access.token_store import TokenStore
from server.http.json_responses import error_response

COOKIE_PREFIX = "myview"
_VALID_KEPT = 4096
"""Valid tokens that are remembered with the address they came from: others' failures do not delay them."""


@dataclass(frozen=True, slots=True)
class Credential:
    """What a request authenticates by: the SHA-256 of a token, and of a session's identifier, if any."""

    token: str
    session: str | None = None


class Authenticator:
    """Finds the credential of a request and the grant that it gives now.

    ``what`` names the service among those of its machine; ``numbered_since`` returns since when people's
    numbers mean the same people, unix seconds; ``now`` is a clock that never steps.
    """

    def __init__(
        self,
        tokens: Path | None,
        what: str = "site",
        now: Callable[[], float] = time.monotonic,
        numbered_since: Callable[[], float] = lambda: 0.0,
    ) -> None:
        """Read the file of tokens.

        Raises:
            UserError: it cannot be read, or something in it is wrong.
        """
        self.cookie = f"{COOKIE_PREFIX}_{what}"
        """Each service has its own: cookies do not tell the ports of a machine apart (RFC 6265, 8.5)."""
        self.sessions = Sessions(now)
        self.file = None if tokens is None else TokenStore(tokens)
        self._numbered_since = numbered_since
        self._rate_limit = LoginRateLimit(now)
        self._valid: OrderedDict[tuple[str, str], None] = OrderedDict()
        self.wrong_tokens = 0
        """Since the start. They are counted and not logged: clients could fill a disk with them."""

    def credential_of(self, request: web.Request) -> Credential | web.Response | None:
        """Return what a request authenticates by; None: nothing. A token that it names precedes a session.

        Returns:
            A response where the token is wrong, or too many wrong ones were sent.
        """
        kind, _, bearer = request.headers.get("Authorization", "").partition(" ")
        token = bearer.strip() if kind.lower() == "bearer" else request.query.get("token")
        if token is not None:
            return self.check_token(request, token)
        session = self.session_of(request)
        digest = self.sessions.token(session)
        return None if digest is None else Credential(digest, session)

    def check_token(self, request: web.Request, token: str) -> Credential | web.Response:
        """Look up a token; refuse a wrong one with 401, and after several of them with 429."""
        digest, address = token_digest(token), request.remote or "?"
        wait = 0.0 if (address, digest) in self._valid else self._rate_limit.wait(address)
        if wait > 0:
            seconds = math.ceil(wait)
            response = error_response(429, f"too many wrong tokens; try again in {seconds} s")
            response.headers["Retry-After"] = str(seconds)
            return response
        if self.file is not None and self.file.find(digest) is not None:
            self._valid[address, digest] = None
            self._valid.move_to_end((address, digest))
            if len(self._valid) > _VALID_KEPT:
                self._valid.popitem(last=False)
            return Credential(digest)
        self._valid.pop((address, digest), None)
        self._rate_limit.add(address)
        self.wrong_tokens += 1
        return challenge("unknown or revoked token")

    def session_of(self, request: web.Request) -> str:
        """Return the SHA-256 of a request's session identifier; there need not be such a session."""
        return token_digest(request.cookies.get(self.cookie, ""))

    def grant_of(self, credential: Credential) -> Grant | str | None:
        """Return what a credential allows now; None: it is revoked or expired; a text: why it is void."""
        if credential.session is not None and self.sessions.token(credential.session) is None:
            return None
        token = None if self.file is None else self.file.get(credential.token)
        if token is None:
            return None
        return self._void(token) or Grant.of(token)

    def _void(self, token: Token) -> str | None:
        """Return why a token for one person does not count any more: numbers mean other people now."""
        if token.object is None or token.made is None or token.made.timestamp() >= self._numbered_since():
            return None
        return (
            f"person numbers have restarted since the token {token.name!r} was made, and object "
            f"{token.object} may be another person: make a new one"
        )


def challenge(error: str) -> web.Response:
    """Return 401 with the way to authenticate (RFC 9110, 15.5.2)."""
    response = error_response(401, error)
    response.headers["WWW-Authenticate"] = "Bearer"
    return response
