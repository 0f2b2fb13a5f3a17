"""A client's side of a closed pulse server: it proves who it is, and believes nothing that is not sealed."""

from __future__ import annotations

from dataclasses import dataclass, field

from camsync.messages import Challenge, Prove, Refusal, ServerLine
from camsync.protocol import ProtocolError, encode, parse_server_line
from camsync.seal import SealError, Seals, new_nonce

_SHOWN = 200  # characters of what somebody says of whom nothing is known


@dataclass(frozen=True, slots=True)
class Login:
    """Who comes, and the password by which a closed server knows them."""

    user: str
    password: str = field(repr=False)


class NotProvenError(Exception):
    """Whoever answers has not proven to know the password, or does not believe that we do; in a sentence."""


class Proof:
    """One connection, from its first line on."""

    def __init__(self, login: Login) -> None:
        self._login = login
        self._seals: Seals | None = None
        self._heard = False  # a sealed line, that is: the server knows the password, too

    def proven(self, first: ServerLine | None) -> bytes:
        """Answer the server's first line; from then on lines are sealed.

        Raises:
            NotProvenError: it is not that of a closed server.
        """
        if isinstance(first, Refusal):
            raise NotProvenError(f"it refuses: {first.text[:_SHOWN]}")
        if not isinstance(first, Challenge):
            raise NotProvenError("it asks for no password, so it may be anybody")
        prove = Prove(self._login.user, new_nonce())
        self._seals = Seals.of(self._login.password, prove.user, (first.nonce, prove.nonce))
        return self.sealed(encode(prove))

    @property
    def begun(self) -> bool:
        """Whether lines are sealed by now."""
        return self._seals is not None

    def sealed(self, lines: bytes) -> bytes:
        """Seal what is to be said."""
        assert self._seals is not None  # noqa: S101 — nothing is said before
        return self._seals.client.sealed(lines)

    def opened(self, line: bytes) -> bytes:
        """Open what was said.

        Raises:
            NotProvenError: it was not the server that said it, or it refuses us.
        """
        assert self._seals is not None  # noqa: S101 — nothing is heard before
        try:
            text = self._seals.server.opened(line)
        except SealError as error:
            raise NotProvenError(self._why(line)) from error
        self._heard = True
        return text

    def _why(self, line: bytes) -> str:
        """Say what is wrong: a server that does not know us cannot seal what it says."""
        try:
            message = parse_server_line(line)
        except ProtocolError:
            message = None
        if isinstance(message, Refusal) and not self._heard:
            return f"it refuses: {message.text[:_SHOWN]}"
        return "what it says is not sealed by the password"
