"""Secrets in files of one line, so that the configuration that others read has none."""

from __future__ import annotations

import base64
import binascii
from pathlib import Path

from server.system.errors import UserError, reason_of

_PREFIX = "whsec_"
_KEY_BYTES = (24, 64)
"""Bytes of a webhook's key, at least and at most (Standard Webhooks 1.0)."""


def read_secret(path: Path, where: str) -> str:
    """Read a secret of one line.

    Raises:
        UserError: the file cannot be read, or is not one line; the text has neither its name nor its content.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = reason_of(error, "it is not text")
        raise UserError(f"{where}: the file cannot be read: {reason}") from None
    secret = text.removesuffix("\n").removesuffix("\r")
    if not secret or not secret.isprintable():
        raise UserError(f"{where}: the file must be one line")
    return secret


def read_webhook_key(path: Path, where: str) -> bytes:
    """Read the key that signs a webhook: ``whsec_`` and 24 to 64 bytes in base64.

    Raises:
        UserError: as :func:`read_secret`, or it is not such a key.
    """
    secret = read_secret(path, where)
    least, most = _KEY_BYTES
    try:
        key = base64.b64decode(secret.removeprefix(_PREFIX), validate=True)
    except binascii.Error:
        key = b""
    if not secret.startswith(_PREFIX) or not least <= len(key) <= most:
        raise UserError(f"{where}: must be {_PREFIX} and {least} to {most} bytes in base64")
    return key
