"""HTTPS: the server's certificate, reloaded when its files change."""

from __future__ import annotations

import logging
import ssl
from pathlib import Path

from server.config.sections import TlsSettings
from server.http.periodic import run_periodically
from server.system.errors import UserError, reason_of
from server.system.file_state import FileState, file_state

log = logging.getLogger(__name__)

_CHECK_EVERY_S = 5.0


class Certificate:
    """A certificate and its key; new connections use the newest valid version."""

    def __init__(self, certificate: Path, key: Path) -> None:
        """Read both files.

        Raises:
            UserError: they cannot be read, or do not belong to each other.
        """
        self._certificate, self._key = certificate, key
        self._seen = self._state()
        """The state of the files that are in force."""
        self._error = ""
        """The error of the current files, logged once; empty: they are valid."""
        self._newest = self._load()
        self.context = self._newest
        # One context per pair: a context keeps a loaded pair beside a later one with another type of key.
        self.context.sni_callback = self._use_newest

    @classmethod
    def of(cls, settings: TlsSettings) -> Certificate | None:
        """Read the configured files; None: none are configured.

        Raises:
            UserError: they cannot be read, or do not belong to each other.
        """
        if settings.certificate is None or settings.key is None:
            return None
        return cls(settings.certificate, settings.key)

    def reload_if_changed(self) -> None:
        """Reload changed files; while they are invalid, the previous certificate stays in force."""
        now = self._state()
        if now == self._seen:
            return
        try:
            self._newest = self._load()
        except UserError as error:  # retried at the next check: a renewal may be half done
            if str(error) != self._error:
                log.warning("%s; the previous certificate stays in force", error)
            self._error = str(error)
        else:
            self._seen, self._error = now, ""
            log.info("%s: used for new connections", self._certificate)

    async def run(self) -> None:
        """Check for changed files periodically."""
        await run_periodically(_CHECK_EVERY_S, self._reload, "reloading the certificate")

    async def _reload(self) -> None:
        self.reload_if_changed()

    def _use_newest(self, connection: ssl.SSLObject, _: str | None, __: ssl.SSLContext) -> None:
        connection.context = self._newest

    def _load(self) -> ssl.SSLContext:
        context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
        for kind, path in (("certificate", self._certificate), ("key", self._key)):
            try:
                path.read_bytes()
            except OSError as error:
                raise UserError(f"http.tls.{kind}: cannot read {path}: {reason_of(error)}") from error
        try:
            context.load_cert_chain(self._certificate, self._key, password=_no_password)
        except (OSError, ValueError) as error:  # an SSL error, or a file was removed meanwhile
            reason = getattr(error, "reason", None) or reason_of(error)
            raise UserError(
                f"http.tls: {self._certificate} and {self._key} are not a certificate and its key: {reason}"
            ) from error
        return context

    def _state(self) -> tuple[FileState | None, ...]:
        return tuple(file_state(path) for path in (self._certificate, self._key))


def _no_password() -> str:
    raise ValueError("the key has a password; save it without one")
