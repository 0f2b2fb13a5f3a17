"""The token file, reloaded when it changes."""

from __future__ import annotations

import hmac
import logging
from collections.abc import Collection
from pathlib import Path

from server.config.tokens_file import Token, read_tokens
from server.system.errors import UserError
from server.system.file_state import file_state

log = logging.getLogger(__name__)


class TokenStore:
    """The tokens in force; while the changed file is invalid or unreadable, the previous ones stay."""

    def __init__(self, path: Path) -> None:
        """Read the file.

        Raises:
            UserError: it cannot be read, or something in it is wrong.
        """
        self._path = path
        self._loaded = self._seen = file_state(path)
        self._tokens = _by_digest(path)

    def reload_if_changed(self) -> None:
        """Reload a changed file once two checks in a row find it the same: before, it may be half-written."""
        before, self._seen = self._seen, file_state(self._path)
        if self._seen == self._loaded or self._seen != before:
            return
        self._loaded = self._seen
        try:
            self._tokens = _by_digest(self._path)
        except UserError as error:
            log.warning("%s; the previous %d tokens stay in force", error, len(self._tokens))
        else:
            log.info("%s: %d tokens are in force", self._path, len(self._tokens))

    @property
    def tokens(self) -> Collection[Token]:
        """The tokens in force."""
        return self._tokens.values()

    def find_in_constant_time(self, token_digest: str) -> Token | None:
        """Return the token with this SHA-256, comparing it with all of them in constant time."""
        match = None
        for token in self._tokens.values():
            if hmac.compare_digest(token.sha256, token_digest):
                match = token
        return match

    def get_unless_revoked(self, token_digest: str) -> Token | None:
        """Return the token with a SHA-256 that was found before; None: it has been revoked since."""
        return self._tokens.get(token_digest)


def _by_digest(path: Path) -> dict[str, Token]:
    return {token.sha256: token for token in read_tokens(path)}
