"""Lines that only who knows a password can have written: what a closed pulse server and its clients say.

Each side chooses a number that is used once (a nonce). Out of the password, both of them and the user's name
comes a key for each way: HMAC (RFC 2104) with SHA-256. A line ends with its MAC, which counts the lines of
its way. So no line can be made, changed, left out, put elsewhere or taken from another connection by anybody
who does not know the password. Whoever overhears lines can read them, and try passwords: these must be long.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from dataclasses import dataclass

NONCE_BYTES = 16
MAC_BYTES = 16  # half of SHA-256: as hard to guess as the nonces
_MARK = b" mac="
_COUNT_BYTES = 8
_LABEL = "myview pulses 2"  # these keys are for nothing else, whatever the password is used for beside


class SealError(ValueError):
    """A line is not what the other side said at this place."""


class Seal:
    """One way of one connection: seals its lines, or opens them, in their order.

    ``key`` is known to the two sides alone.
    """

    def __init__(self, key: bytes) -> None:
        self._key = key
        self._count = 0

    def sealed(self, lines: bytes) -> bytes:
        """Give whole lines with their MACs, line ends included."""
        return b"".join(self._sealed(line) for line in lines.splitlines())

    def opened(self, line: bytes) -> bytes:
        """Give a line without its MAC, both without the line end.

        Raises:
            SealError: it is not the next line of this way.
        """
        text, mark, mac = line.rpartition(_MARK)
        if not mark or not hmac.compare_digest(mac, self._mac(text)):
            raise SealError("a line is not sealed as it should be")
        self._count += 1
        return text

    def _sealed(self, line: bytes) -> bytes:
        mac = self._mac(line)
        self._count += 1
        return line + _MARK + mac + b"\n"

    def _mac(self, line: bytes) -> bytes:
        counted = self._count.to_bytes(_COUNT_BYTES, "big") + line
        return hmac.digest(self._key, counted, "sha256")[:MAC_BYTES].hex().encode()


@dataclass(frozen=True, slots=True)
class Seals:
    """Both ways of one connection."""

    client: Seal
    """What the client says."""
    server: Seal
    """What the server says."""

    @classmethod
    def of(cls, password: str, user: str, nonces: tuple[str, str]) -> Seals:
        """Make the keys of a connection; ``nonces`` are the server's and the client's."""
        secret = hashlib.sha256(password.encode()).digest()  # HMAC itself takes "a" and "a\0" for one key

        def seal(way: str) -> Seal:
            about = "\n".join((_LABEL, way, user, *nonces))
            return Seal(hmac.digest(secret, about.encode(), "sha256"))

        return cls(seal("client"), seal("server"))


def new_nonce() -> str:
    """Give a number that nobody can foresee, and that is used once: 32 hexadecimal digits."""
    return secrets.token_hex(NONCE_BYTES)
