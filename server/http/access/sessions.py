"""Sessions: a cookie instead of a token, for browsers that have signed in."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from dataclasses import dataclass

from server.config.tokens_file import token_digest

SESSION_LIFETIME_S = 12 * 3600
_PER_TOKEN = 1024
"""Sessions of one token: they never push out those of another."""


@dataclass(frozen=True, slots=True)
class _Session:
    token: str
    expires: float


class Sessions:
    """Who has signed in by which token, in memory; ``now`` is a clock in seconds that never steps."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._sessions: dict[str, _Session] = {}
        """By the identifier's SHA-256, so that the time of a lookup reveals nothing of the identifier."""

    def open(self, token: str) -> str:
        """Open a session for a token, named by its SHA-256; return the identifier for a cookie."""
        now = self._now()
        self._sessions = {it: session for it, session in self._sessions.items() if session.expires > now}
        same_token = [it for it, session in self._sessions.items() if session.token == token]
        if len(same_token) >= _PER_TOKEN:
            del self._sessions[same_token[0]]  # the oldest
        identifier = secrets.token_urlsafe(32)
        self._sessions[token_digest(identifier)] = _Session(token, now + SESSION_LIFETIME_S)
        return identifier

    def token(self, key: str) -> str | None:
        """Return the SHA-256 of a session's token by that of its identifier; None: no session, or expired."""
        session = self._sessions.get(key)
        return session.token if session is not None and session.expires > self._now() else None

    def close(self, key: str) -> None:
        """Close a session."""
        self._sessions.pop(key, None)
