"""Authentication: find the token or session of a request and check that it is valid.

A token comes as ``Authorization: Bearer``, as ``?token=``, or through a session cookie. Unknown, revoked and
expired tokens are refused here, and addresses that send too many wrong ones are rate limited.
"""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from aiohttp import web

from server.config.tokens_file import Token, secret_digest
from server.http.access.permissions import Grant
from server.http.access.sessions import Sessions
from server.http.access.token_store import TokenStore
from server.http.access.wrong_token_rate_limit import WrongTokenRateLimit
from server.http.json_responses import error_response

COOKIE_PREFIX = "myview"
VoidReason = str
"""Why a token is void, in words."""
_VALID_KEPT = 4096
"""Valid tokens remembered by address; wrong tokens from the same address do not delay them."""


@dataclass(frozen=True, slots=True)
class Credential:
    """The SHA-256 of a request's token, and of its session identifier if it has a session."""

    token_digest: str
    session_digest: str | None = None


class Authenticator:
    """Finds the credential of a request and its current grant.

    ``service_name`` distinguishes the service from others on its machine; ``numbered_since`` returns the unix
    time since which a person number has kept its meaning, infinite while that is unknown; ``now`` is a
    monotonic clock in seconds.
    """

    def __init__(
        self,
        tokens: Path | None,
        service_name: str = "site",
        now: Callable[[], float] = time.monotonic,
        numbered_since: Callable[[int], float] = lambda _: 0.0,
    ) -> None:
        """Read the token file.

        Raises:
            UserError: it cannot be read, or something in it is wrong.
        """
        self.cookie = f"{COOKIE_PREFIX}_{service_name}"
        """Each service has its own cookie: all ports of a host share cookies (RFC 6265, 8.5)."""
        self.sessions = Sessions(now)
        self.file = None if tokens is None else TokenStore(tokens)
        self._numbered_since = numbered_since
        self._rate_limit = WrongTokenRateLimit(now)
        self._valid: OrderedDict[tuple[str, str], None] = OrderedDict()
        self.wrong_tokens = 0
        """Wrong tokens since the start; not logged, since clients could fill the disk with such lines."""

    def credential_of(self, request: web.Request) -> Credential | web.Response | None:
        """Return the credential of a request; a token takes precedence over a session.

        Returns:
            None without a token or session; a response if the token is wrong or the address is rate limited.
        """
        kind, _, bearer = request.headers.get("Authorization", "").partition(" ")
        token = bearer.strip() if kind.lower() == "bearer" else request.query.get("token")
        if token is not None:
            return self.check_token(request, token)
        session_digest = self.session_digest_of(request)
        digest = self.sessions.token_digest_of(session_digest)
        return None if digest is None else Credential(digest, session_digest)

    def check_token(self, request: web.Request, token: str) -> Credential | web.Response:
        """Look up a token; answer 401 to a wrong one, and 429 after several wrong ones."""
        digest, address = secret_digest(token), request.remote or "?"
        wait = 0.0 if (address, digest) in self._valid else self._rate_limit.wait(address)
        if wait > 0:
            seconds = math.ceil(wait)
            response = error_response(429, f"too many wrong tokens; try again in {seconds} s")
            response.headers["Retry-After"] = str(seconds)
            return response
        if self.file is not None and self.file.find_in_constant_time(digest) is not None:
            self._valid[address, digest] = None
            self._valid.move_to_end((address, digest))
            if len(self._valid) > _VALID_KEPT:
                self._valid.popitem(last=False)
            return Credential(digest)
        self._valid.pop((address, digest), None)
        self._rate_limit.add(address)
        self.wrong_tokens += 1
        return challenge("unknown or revoked token")

    def session_digest_of(self, request: web.Request) -> str:
        """Return the SHA-256 of a request's session identifier, whether or not the session exists."""
        return secret_digest(request.cookies.get(self.cookie, ""))

    def grant_of(self, credential: Credential) -> Grant | VoidReason | None:
        """Return the current grant of a credential, or why its token is void; None: revoked or expired."""
        if (
            credential.session_digest is not None
            and self.sessions.token_digest_of(credential.session_digest) is None
        ):
            return None
        token = None if self.file is None else self.file.get_unless_revoked(credential.token_digest)
        if token is None:
            return None
        return self._void_reason(token) or Grant.of(token)

    def tokens_of_viewers(self) -> list[tuple[str, int]]:
        """Return the SHA-256 of each token that shows people, and the only person whom it is for, or 0."""
        tokens = () if self.file is None else self.file.tokens
        return [
            (token.sha256, token.object or 0)
            for token in tokens
            if token.camera is None and not self._void_reason(token)
        ]

    def _void_reason(self, token: Token) -> VoidReason | None:
        """Return why a token for one person is void: person numbers have restarted since it was made."""
        if token.object is None or token.made is None:
            return None
        since = self._numbered_since(token.object)
        if token.made.timestamp() >= since:
            return None
        if math.isinf(since):
            return (
                f"the token {token.name!r} is for object {token.object}, whose number is of another site "
                "that has not been heard: try again once it is up"
            )
        return (
            f"person numbers have restarted since the token {token.name!r} was made, and object "
            f"{token.object} may be another person: make a new one"
        )


def challenge(error: str) -> web.Response:
    """Return 401 with a WWW-Authenticate challenge (RFC 9110, 15.5.2)."""
    response = error_response(401, error)
    response.headers["WWW-Authenticate"] = "Bearer"
    return response
