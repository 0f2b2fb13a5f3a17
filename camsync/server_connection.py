"""A client's connection to the pulse server: logs in, parses lines, sends PING, detects silence."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import cast

from camsync.clock import Clock
from camsync.lines import LineBuffer, OverlongLineError
from camsync.login import Credentials
from camsync.messages import ClientLine, ErrorMessage, Greeting, LoginMessage, LoginRequest, Ping, ServerLine
from camsync.protocol import MAX_SERVER_LINE, ProtocolError, encode, parse_server_line

_QUICK_PINGS = 5  # at the beginning, for an accurate offset within a fraction of a second
_QUICK_INTERVAL = 0.05  # seconds between them


class ServerConnection(asyncio.Protocol):
    """One connection. ``receive`` gets every message from the greeting on, with its time of arrival.

    With ``credentials`` it answers the server's login request; without, ``receive`` gets the request.
    ``hello`` builds the line that opens the connection: at once, or after the greeting if a login is needed.
    It sends PING every ``ping_interval`` seconds, and closes after ``silence`` seconds without a byte;
    with an infinite interval it does neither.
    """

    def __init__(
        self,
        receive: Callable[[ServerLine, float], None],
        clock: Clock,
        credentials: Credentials | None = None,
        *,
        hello: Callable[[], ClientLine] | None = None,
        ping_interval: float = math.inf,
        silence: float = math.inf,
    ) -> None:
        self._credentials = credentials
        self._receive = receive
        self._hello = hello
        self._clock = clock
        self._ping_interval = ping_interval
        self._silence = silence
        self._lines = LineBuffer(MAX_SERVER_LINE)
        self._transport: asyncio.Transport | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._pings = 0
        self._last_byte_at = 0.0
        self._opened = False
        self.greeted = False
        self.lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        """Done when the connection has ended; the result is the reason."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Send HELLO unless a login is needed first, and start sending PING (called by asyncio)."""
        self._transport = cast("asyncio.Transport", transport)
        self._last_byte_at = self._clock()
        if self._credentials is None:
            self._open()
        if self._ping_interval < math.inf:
            self._ping()

    def data_received(self, data: bytes) -> None:
        """Parse what the server sends (called by asyncio)."""
        self._last_byte_at = now = self._clock()
        try:
            for line in self._lines.feed(data):
                self._handle_line(line, now)
                if self.lost.done():
                    return
        except (ProtocolError, OverlongLineError) as error:
            self.end(f"not the pulse protocol ({error})")

    def connection_lost(self, exc: Exception | None) -> None:
        """End the connection (called by asyncio)."""
        self._transport = None
        self.end(str(exc) if exc else "the server closed the connection")

    def send(self, message: ClientLine) -> None:
        """Send a message, if the connection is open."""
        if self._transport is not None:
            self._transport.write(encode(message))

    def end(self, reason: str) -> None:
        """Abort the connection."""
        if self._timer is not None:
            self._timer.cancel()
        if not self.lost.done():
            self.lost.set_result(reason)
        if self._transport is not None:
            self._transport.abort()

    def _handle_line(self, line: bytes, now: float) -> None:
        message = parse_server_line(line)
        if isinstance(message, LoginRequest) and self._credentials is not None:
            self.send(LoginMessage(self._credentials.user, self._credentials.password))
            return
        if isinstance(message, Greeting):
            self.greeted = True
            self._open()
        elif not self.greeted and not isinstance(message, ErrorMessage | LoginRequest):
            raise ProtocolError("malformed", "the first line is not a greeting")
        if message is not None:
            self._receive(message, now)

    def _open(self) -> None:
        if not self._opened:
            self._opened = True
            if self._hello is not None:
                self.send(self._hello())

    def _ping(self) -> None:
        now = self._clock()
        if self._transport is None:
            return
        if now - self._last_byte_at > self._silence:
            self.end(f"nothing received for {self._silence:g} seconds")
            return
        if self._opened:
            self.send(Ping(now))
        self._pings += 1
        wait = _QUICK_INTERVAL if self._pings < _QUICK_PINGS else self._ping_interval
        self._timer = asyncio.get_running_loop().call_later(min(wait, self._ping_interval), self._ping)
