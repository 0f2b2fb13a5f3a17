"""Sessions: signed-in browsers authenticate by a cookie instead of a token."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from dataclasses import dataclass

from server.config.tokens_file import secret_digest

SESSION_LIFETIME_S = 12 * 3600
_SESSIONS_PER_TOKEN = 1024
"""Beyond this, a token's oldest session is closed; other tokens' sessions are not affected."""


@dataclass(frozen=True, slots=True)
class _Session:
    token_digest: str
    expires: float


class Sessions:
    """Open sessions and their tokens, in memory; ``now`` is a monotonic clock in seconds."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._sessions: dict[str, _Session] = {}
        """By the identifier's SHA-256, so that the timing of a lookup reveals nothing of the identifier."""

    def open(self, token_digest: str) -> str:
        """Open a session for the token of this SHA-256; return the session's identifier, for the cookie."""
        now = self._now()
        self._sessions = {key: session for key, session in self._sessions.items() if session.expires > now}
        same_token = [key for key, session in self._sessions.items() if session.token_digest == token_digest]
        if len(same_token) >= _SESSIONS_PER_TOKEN:
            del self._sessions[same_token[0]]  # the oldest
        identifier = secrets.token_urlsafe(32)
        self._sessions[secret_digest(identifier)] = _Session(token_digest, now + SESSION_LIFETIME_S)
        return identifier

    def token_digest_of(self, session_digest: str) -> str | None:
        """Return the SHA-256 of a session's token; ``session_digest`` is that of its identifier.

        Returns:
            None: there is no such session, or it has expired.
        """
        session = self._sessions.get(session_digest)
        return session.token_digest if session is not None and session.expires > self._now() else None

    def close(self, session_digest: str) -> None:
        """Close the session whose identifier has this SHA-256."""
        self._sessions.pop(session_digest, None)
