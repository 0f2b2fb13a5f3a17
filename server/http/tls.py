"""HTTPS from certificate files, which are read again when they change."""

from __future__ import annotations

import logging
import ssl
from pathlib import Path

from server.config.sections import TlsSettings
from server.http.periodic import run_periodically
from server.system.errors import UserError
from server.system.file_state import FileState, file_state

log = logging.getLogger(__name__)

_CHECK_EVERY_S = 5.0


class Certificate:
    """A certificate and its key. New connections use the newest that could be read."""

    def __init__(self, certificate: Path, key: Path) -> None:
        """Read both files.

        Raises:
            UserError: they cannot be read, or do not belong together.
        """
        self._certificate, self._key = certificate, key
        self._seen = self._state()
        """The state of the files that are in force."""
        self._error = ""
        """Why the files as they are now could not be read; logged once."""
        self._newest = self._load()
        self.context = self._newest
        # A context keeps what it has loaded beside a later key of another kind: each pair has its own.
        self.context.sni_callback = self._use_newest

    @classmethod
    def of(cls, settings: TlsSettings) -> Certificate | None:
        """Read the files that a configuration names; None: it names none.

        Raises:
            UserError: it cannot be read.
        """
        if settings.certificate is None or settings.key is None:
            return None
        return cls(settings.certificate, settings.key)

    def reload_if_changed(self) -> None:
        """Read the files again if they have changed; what cannot be read leaves the old one in force."""
        now = self._state()
        if now == self._seen:
            return
        try:
            self._newest = self._load()
        except UserError as error:  # read again at the next check: it may be half of a renewal
            if str(error) != self._error:
                log.warning("%s; the previous certificate stays in force", error)
            self._error = str(error)
        else:
            self._seen, self._error = now, ""
            log.info("%s: used for new connections", self._certificate)

    async def run(self) -> None:
        """Check for changed files again and again."""
        await run_periodically(_CHECK_EVERY_S, self._reload, "reading the certificate again")

    async def _reload(self) -> None:
        self.reload_if_changed()

    def _use_newest(self, connection: ssl.SSLObject, _: str | None, __: ssl.SSLContext) -> None:
        connection.context = self._newest

    def _load(self) -> ssl.SSLContext:
        context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
        for what, path in (("certificate", self._certificate), ("key", self._key)):
            try:
                path.read_bytes()
            except OSError as error:
                raise UserError(f"http.tls.{what}: cannot read {path}: {error.strerror}") from error
        try:
            context.load_cert_chain(self._certificate, self._key, password=_no_password)
        except (OSError, ValueError) as error:  # of ssl, or one of them has gone this very moment
            reason = getattr(error, "reason", None) or getattr(error, "strerror", None) or str(error)
            raise UserError(
                f"http.tls: {self._certificate} and {self._key} are not a certificate and its key: {reason}"
            ) from error
        return context

    def _state(self) -> tuple[FileState | None, ...]:
        return tuple(file_state(it) for it in (self._certificate, self._key))


def _no_password() -> str:
    raise ValueError("the key has a password; save it without one")
