"""Messages between the pulse server and its clients; ``protocol`` encodes and parses them as lines.

All times are unix seconds.
"""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class CountedPulse:
    """The last pulse a client has counted: ``number``, due ``ago`` seconds before the line was sent."""

    number: int
    ago: float


@dataclass(frozen=True, slots=True)
class Hello:
    """A client is ready for pulses under a name; ``known`` if it has counted pulses before."""

    name: str
    known: CountedPulse | None = None


@dataclass(frozen=True, slots=True)
class Ping:
    """A client requests the server clock; ``sent`` is the client's clock."""

    sent: float


@dataclass(frozen=True, slots=True)
class ClientsRequest:
    """A client requests the list of clients."""


@dataclass(frozen=True, slots=True)
class LoginMessage:
    """A client logs in."""

    user: str
    password: str = field(repr=False)


@dataclass(frozen=True, slots=True)
class LoginRequest:
    """The first line of a server that needs a login; ``now`` is the server clock."""

    now: float


@dataclass(frozen=True, slots=True)
class Greeting:
    """The server's first line to a client that needs no login, or has logged in.

    ``pulse`` is the last pulse sent, None before the first.
    """

    version: int
    fps: float
    now: float
    pulse: int | None


@dataclass(frozen=True, slots=True)
class WaitMessage:
    """The server has not sent pulse 0 yet: it waits for ``names``."""

    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class PulseMessage:
    """Pulse ``number``, due at ``due`` on the server clock."""

    number: int
    due: float


@dataclass(frozen=True, slots=True)
class Pong:
    """The answer to a Ping: its ``sent``, and the server clock ``now``."""

    sent: float
    now: float


@dataclass(frozen=True, slots=True)
class ListedClient:
    """A client of the server: ``name`` is None before HELLO; the pulses dropped since the last one sent."""

    name: str | None
    dropped_in_a_row: int


@dataclass(frozen=True, slots=True)
class ClientList:
    """The answer to ClientsRequest: all other clients, in the order of joining."""

    clients: tuple[ListedClient, ...]


@dataclass(frozen=True, slots=True)
class ErrorMessage:
    """The server's ERROR line: ``code`` for programs, ``text`` for people."""

    code: str
    text: str


ClientLine = Hello | Ping | ClientsRequest | LoginMessage
ServerLine = LoginRequest | Greeting | WaitMessage | PulseMessage | Pong | ClientList | ErrorMessage
