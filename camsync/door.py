"""Who has come to a closed pulse server and has not proven yet who they are: they are told nothing."""

from __future__ import annotations

import asyncio
import logging
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from camsync.client_eviction import who_makes_room
from camsync.clock import Clock
from camsync.limits import ServerLimits
from camsync.log_throttle import Spell
from camsync.messages import Challenge, Prove
from camsync.protocol import ProtocolError, encode, parse_client_line
from camsync.seal import SealError, Seals, new_nonce

_log = logging.getLogger(__name__)
_REFUSED = "closed"  # the code of a refusal


class Visitor(Protocol):
    """A connection that is at the door."""

    @property
    def address(self) -> str:
        """Where it comes from: ``host:port``."""

    @property
    def origin(self) -> str:
        """The host that it comes from."""

    def say(self, line: bytes) -> bool:
        """Send a line; say whether it was sent."""

    def end(self, code: str, text: str) -> None:
        """Close the connection, telling why."""


@dataclass(frozen=True, slots=True)
class _Waiting:
    visitor: Visitor
    nonce: str
    timer: asyncio.TimerHandle


class Door:
    """Lets in who knows the password of a user; ``users`` has them by name.

    A name that is not known is refused as a wrong password is. Of very many who wait, the oldest of the
    address that has the most makes way: who knows a password needs no longer than an answer takes.
    """

    def __init__(self, users: Mapping[str, str], limits: ServerLimits, clock: Clock) -> None:
        self._users = dict(users)
        self._nobody = secrets.token_hex()  # the password of names that are not known
        self._limits = limits
        self._clock = clock
        self._waiting: dict[int, _Waiting] = {}  # by id(), in the order of coming
        self._refused = 0
        self._refusals = Spell(clock)  # strangers may be many

    @property
    def refused(self) -> int:
        """How many were not let in."""
        return self._refused

    def knock(self, visitor: Visitor) -> None:
        """Ask a new connection who it is."""
        if len(self._waiting) >= self._limits.strangers:
            crowded_out = who_makes_room([it.visitor for it in self._waiting.values()])
            self._refuse(crowded_out, "too many others have come, and no proof")
        nonce = new_nonce()
        timer = asyncio.get_running_loop().call_later(
            self._limits.prove_within, self._refuse, visitor, "no proof has come"
        )
        self._waiting[id(visitor)] = _Waiting(visitor, nonce, timer)
        visitor.say(encode(Challenge(nonce, self._clock())))

    def prove(self, visitor: Visitor, line: bytes) -> tuple[str, Seals] | None:
        """Read a visitor's first line; give who it is and its seals, or refuse it."""
        nonce = self._waiting[id(visitor)].nonce
        try:
            user, seals = self._proven(line, nonce)
        except ProtocolError as error:
            self._refuse(visitor, str(error))
        except SealError:
            self._refuse(visitor, "there is no such user, or the password is another")
        else:
            self.left(visitor)
            return user, seals
        return None

    def _proven(self, line: bytes, nonce: str) -> tuple[str, Seals]:
        message = parse_client_line(line)
        if not isinstance(message, Prove):
            raise ProtocolError(_REFUSED, "who comes to this server has to prove that they know a password")
        seals = Seals.of(self._users.get(message.user, self._nobody), message.user, (nonce, message.nonce))
        seals.client.opened(line)
        return message.user, seals

    def left(self, visitor: Visitor) -> None:
        """Forget who is not at the door any more."""
        waiting = self._waiting.pop(id(visitor), None)
        if waiting is not None:
            waiting.timer.cancel()

    def close(self) -> None:
        """Send all away: the server stops."""
        for waiting in tuple(self._waiting.values()):
            self.left(waiting.visitor)
            waiting.visitor.end("stopped", "the server stops")

    def _refuse(self, visitor: Visitor, why: str) -> None:
        self.left(visitor)
        self._refused += 1
        if self._refusals.happened() is not None:
            _log.warning("%s is not let in (%d so far): %s", visitor.address, self._refused, why)
        visitor.end(_REFUSED, why)
