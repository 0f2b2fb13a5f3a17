"""Sign-ins: a cookie instead of a token, for browsers."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from dataclasses import dataclass

from server.config.tokens_file import token_digest

SESSION_S = 12 * 3600
"""Seconds that a sign-in lasts."""
_EACH = 1024
"""Sign-ins of one token: whoever has another's is not signed out by them."""


@dataclass(frozen=True, slots=True)
class _Session:
    token: str
    ends: float


class Sessions:
    """Who is signed in, and by which token; all of it in memory."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._sessions: dict[str, _Session] = {}
        """By the identifier's SHA-256: looking those up tells nothing of the identifier."""

    def open(self, token: str) -> str:
        """Sign in by a token, which is named by its SHA-256; give the identifier, for a cookie."""
        now = self._now()
        self._sessions = {it: session for it, session in self._sessions.items() if session.ends > now}
        others = [it for it, session in self._sessions.items() if session.token == token]
        if len(others) >= _EACH:
            del self._sessions[others[0]]  # the oldest
        identifier = secrets.token_urlsafe(32)
        self._sessions[token_digest(identifier)] = _Session(token, now + SESSION_S)
        return identifier

    def token(self, key: str) -> str | None:
        """Give the SHA-256 of the token that somebody signed in by; ``key`` is that of the identifier."""
        session = self._sessions.get(key)
        return session.token if session is not None and session.ends > self._now() else None

    def close(self, key: str) -> None:
        """Sign out."""
        self._sessions.pop(key, None)
