"""What the pulse server and its clients say to each other; ``protocol`` writes and reads it as lines.

All times are unix seconds.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Known:
    """The axis a client has counted on: pulse ``number`` was due ``ago`` seconds before the line was sent."""

    number: int
    ago: float


@dataclass(frozen=True, slots=True)
class Hello:
    """A client gives its name and is ready; ``known`` if it has counted pulses before."""

    name: str
    known: Known | None = None


@dataclass(frozen=True, slots=True)
class Ping:
    """A client asks for the server clock; ``sent`` is its own clock."""

    sent: float


@dataclass(frozen=True, slots=True)
class Who:
    """A client asks who else is there."""


@dataclass(frozen=True, slots=True)
class Prove:
    """A client of a closed server says who it is, its line sealed: the proof. ``nonce`` is its own."""

    user: str
    nonce: str


@dataclass(frozen=True, slots=True)
class Challenge:
    """A closed server's first line: who comes has to prove who they are; ``now`` is the server clock."""

    nonce: str
    now: float


@dataclass(frozen=True, slots=True)
class Greeting:
    """An open server's first line, or a closed one's to who has proven themselves.

    ``pulse`` is the last pulse sent, None before the first.
    """

    version: int
    fps: float
    now: float
    pulse: int | None


@dataclass(frozen=True, slots=True)
class Wait:
    """The server has not begun: it waits for ``names``."""

    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Beat:
    """Pulse ``number``, due at ``due`` on the server clock."""

    number: int
    due: float


@dataclass(frozen=True, slots=True)
class Pong:
    """The answer to a Ping: its ``sent``, and the server clock ``now``."""

    sent: float
    now: float


@dataclass(frozen=True, slots=True)
class Listener:
    """A client of the server: ``name`` is None where it only listens; ``behind`` pulses it has just lost."""

    name: str | None
    behind: int


@dataclass(frozen=True, slots=True)
class Clients:
    """The answer to Who: everybody but who asks, in the order of joining."""

    clients: tuple[Listener, ...]


@dataclass(frozen=True, slots=True)
class Refusal:
    """The server's ERROR line: ``code`` for programs, ``text`` for people."""

    code: str
    text: str


ClientLine = Hello | Ping | Who | Prove
ServerLine = Challenge | Greeting | Wait | Beat | Pong | Clients | Refusal
