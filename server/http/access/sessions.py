"""Sessions: signed-in browsers authenticate by a cookie instead of a token."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from dataclasses import dataclass

from server.config.tokens_file import token_digest

SESSION_LIFETIME_S = 12 * 3600
_SESSIONS_PER_TOKEN = 1024
"""Beyond this, a token's oldest session is closed; other tokens' sessions are not affected."""


@dataclass(frozen=True, slots=True)
class _Session:
    token: str
    expires: float


class Sessions:
    """Open sessions and their tokens, in memory; ``now`` is a monotonic clock in seconds."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._sessions: dict[str, _Session] = {}
        """By the identifier's SHA-256, so that the timing of a lookup reveals nothing of the identifier."""

    def open(self, token: str) -> str:
        """Open a session for a token, given by its SHA-256; return the identifier for the cookie."""
        now = self._now()
        self._sessions = {key: session for key, session in self._sessions.items() if session.expires > now}
        same_token = [key for key, session in self._sessions.items() if session.token == token]
        if len(same_token) >= _SESSIONS_PER_TOKEN:
            del self._sessions[same_token[0]]  # the oldest
        identifier = secrets.token_urlsafe(32)
        self._sessions[token_digest(identifier)] = _Session(token, now + SESSION_LIFETIME_S)
        return identifier

    def token(self, key: str) -> str | None:
        """Return the SHA-256 of a session's token; ``key`` is that of its identifier.

        Returns:
            None: there is no such session, or it has expired.
        """
        session = self._sessions.get(key)
        return session.token if session is not None and session.expires > self._now() else None

    def close(self, key: str) -> None:
        """Close a session."""
        self._sessions.pop(key, None)
