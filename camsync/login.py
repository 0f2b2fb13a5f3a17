"""Login to a pulse server that has users: TLS first, then one line with a name and a password.

TLS keeps the password and the pulses private, and authenticates the server by its certificate. A server
without TLS can have users too, but its passwords can be read on the network.
"""

from __future__ import annotations

import asyncio
import hmac
import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from camsync.clock import Clock
from camsync.limits import ServerLimits, select_evicted
from camsync.messages import LoginMessage, LoginRequest
from camsync.protocol import ProtocolError, encode, parse_client_line
from logthrottle import LogThrottle

_log = logging.getLogger(__name__)
_LOGIN_ERROR = "login"
"""The code of the ERROR line that refuses a login."""


@dataclass(frozen=True, slots=True)
class Credentials:
    """The name and password that a client logs in with."""

    user: str
    password: str = field(repr=False)


class PendingConnection(Protocol):
    """A connection that has not logged in yet."""

    @property
    def address(self) -> str:
        """``host:port`` of the client."""

    @property
    def user_or_host(self) -> str:
        """The host of the client, who has not logged in."""

    def send(self, line: bytes) -> bool:
        """Send a line; return whether it was sent."""

    def end(self, code: str, text: str) -> None:
        """Close the connection with an ERROR line."""


@dataclass(frozen=True, slots=True)
class _Pending:
    connection: PendingConnection
    timer: asyncio.TimerHandle


class LoginGate:
    """Holds connections back until their TLS handshake and their login are done.

    ``users`` maps names to passwords; None: no login, the gate bounds TLS handshakes alone. An unknown name
    is refused like a wrong password. If too many connections are pending, the oldest of the address that has
    the most is closed: a legitimate client logs in within one round trip.
    """

    def __init__(self, users: Mapping[str, str] | None, limits: ServerLimits, clock: Clock) -> None:
        self._users = None if users is None else dict(users)
        self._limits = limits
        self._clock = clock
        self._pending: dict[int, _Pending] = {}  # by id(), in the order of arrival
        self._refused = 0
        self._refusals = LogThrottle(clock)

    @property
    def refused(self) -> int:
        """Connections that were refused."""
        return self._refused

    def hold(self, connection: PendingConnection) -> None:
        """Hold a new connection for at most ``limits.login_within`` seconds."""
        if len(self._pending) >= self._limits.pending_logins:
            evicted = select_evicted([pending.connection for pending in self._pending.values()])
            self.refuse(evicted, "too many connections have not logged in")
        timer = asyncio.get_running_loop().call_later(
            self._limits.login_within, self.refuse, connection, "no login in time"
        )
        self._pending[id(connection)] = _Pending(connection, timer)

    def send_login_request(self, connection: PendingConnection) -> bool:
        """Send the login request, once TLS is ready; return False if no login is needed."""
        if self._users is None:
            self.forget(connection)
            return False
        connection.send(encode(LoginRequest(self._clock())))
        return True

    def log_in(self, connection: PendingConnection, line: bytes) -> str | None:
        """Log in a connection by its first line and return the user; else refuse it and return None."""
        try:
            message = parse_client_line(line)
        except ProtocolError as error:
            self.refuse(connection, str(error))
            return None
        if self._users is None or not isinstance(message, LoginMessage):
            self.refuse(connection, "a login has to come first")
        elif not self._is_correct(message):
            self.refuse(connection, "unknown user or wrong password")
        else:
            self.forget(connection)
            return message.user
        return None

    def _is_correct(self, message: LoginMessage) -> bool:
        expected = (self._users or {}).get(message.user)  # an unknown name takes as long as a wrong password
        same = hmac.compare_digest((expected or "").encode(), message.password.encode())
        return same and expected is not None

    def forget(self, connection: PendingConnection) -> None:
        """Release a connection."""
        pending = self._pending.pop(id(connection), None)
        if pending is not None:
            pending.timer.cancel()

    def close(self) -> None:
        """Close all pending connections."""
        for pending in tuple(self._pending.values()):
            self.forget(pending.connection)
            pending.connection.end("stopped", "the server stops")

    def refuse(self, connection: PendingConnection, reason: str) -> None:
        """Close a connection that has not logged in."""
        if self._pending.get(id(connection)) is None:
            return
        self.forget(connection)
        self._refused += 1
        if self._refusals.record() is not None:
            _log.warning("refused %s (%d so far): %s", connection.address, self._refused, reason)
        connection.end(_LOGIN_ERROR, reason)
