"""One client's connection, seen from the server."""

from __future__ import annotations

import asyncio
import logging
import socket
from dataclasses import dataclass
from typing import Protocol, cast

from camsync.clock import Clock
from camsync.door import Door
from camsync.limits import ServerLimits
from camsync.lines import LineBuffer, OverlongLineError, RateLimit
from camsync.messages import Clients, Hello, Listener, Ping, Pong, Prove, Refusal, Who
from camsync.protocol import MAX_LINE, ProtocolError, encode, parse_client_line
from camsync.seal import SealError, Seals

_log = logging.getLogger(__name__)
_SEND_BUFFER = 4096  # bytes in the kernel: a slow client is to be seen within seconds, not an hour of pulses
_KEEPALIVE = 5  # seconds of quiet before the kernel asks whether the client is still there


@dataclass(frozen=True, slots=True)
class ClientInfo:
    """What the server knows of one client."""

    name: str | None
    """The name it said HELLO with; None for one that only listens."""
    address: str
    """``host:port``."""
    joined: float
    """When it connected: unix seconds, server clock."""
    sent: int
    """Pulses handed to its connection."""
    dropped: int
    """Pulses it lost because it did not read."""
    behind: int
    """Pulses lost in a row until now: 0 for a client that keeps up."""
    errors: int
    """Lines of it that were not understood."""


class PeerHub(Protocol):
    """Who a peer reports to."""

    def joined(self, peer: Peer) -> None:
        """Take in a new connection."""

    def left(self, peer: Peer) -> None:
        """Forget a connection: it has ended."""

    def clients(self) -> tuple[ClientInfo, ...]:
        """Give all clients in the order in which they joined."""

    def hello(self, peer: Peer, hello: Hello) -> None:
        """Take a client's name; ProtocolError if it may not have it."""


class Peer(asyncio.Protocol):
    """One client: never waited for, bounded in what it may send and in what waits for it.

    Where there is a ``door`` it joins the others once it has proven who it is.
    """

    def __init__(self, hub: PeerHub, clock: Clock, limits: ServerLimits, door: Door | None = None) -> None:
        self._hub = hub
        self._door = door
        self._seals: Seals | None = None
        self._clock = clock
        self._limits = limits
        self._lines = LineBuffer(MAX_LINE)
        self._joined = clock()
        self._rate = RateLimit(limits.line_burst, limits.line_rate, self._joined)
        self._kept_up = self._joined  # when a pulse last went out to it
        self._transport: asyncio.Transport | None = None
        self._sent = self._dropped = self._behind = self._errors = 0
        self.address = self._host = "?"
        self.name: str | None = None
        self.user: str | None = None
        """Who it has proven to be; None: it was not asked."""

    @property
    def origin(self) -> str:
        """Whose connection it is: the user's that it has proven to be, or else its host's."""
        return self.user or self._host

    def info(self) -> ClientInfo:
        """Give what is known of this client now."""
        return ClientInfo(
            self.name, self.address, self._joined, self._sent, self._dropped, self._behind, self._errors
        )

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Start serving the client (called by asyncio)."""
        self._transport = cast("asyncio.Transport", transport)
        self._host, port, *_ = transport.get_extra_info("peername") or ("?", 0)
        self.address = f"{self._host}:{port}"
        _tune(transport.get_extra_info("socket"), self._limits.cut_off)
        if self._door is None:
            self._hub.joined(self)
        else:
            self._door.knock(self)

    def data_received(self, data: bytes) -> None:
        """Answer what the client says (called by asyncio)."""
        try:
            for line in self._lines.feed(data):
                if self._closing:
                    return
                if not self._rate.take(self._clock()):
                    self.end("flood", "too many lines")
                    return
                self._take(line)
        except OverlongLineError as error:
            self._errors += 1
            self.end("overlong", str(error))

    def eof_received(self) -> bool:
        """Keep sending to a listener that has nothing to say, as ``nc`` with its input closed (asyncio).

        One that has said HELLO has gone: else a camera that left would still count as waited for.
        """
        return self.name is None

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the client (called by asyncio)."""
        _log.debug("client %s (%s) left: %s", self.name, self.address, exc or "closed")
        self._transport = None
        if self._door is not None:
            self._door.left(self)
        self._hub.left(self)

    def say(self, line: bytes) -> bool:
        """Send a line unless too much waits already; say whether it was sent."""
        transport = self._transport
        if transport is None or transport.is_closing():
            return False
        if transport.get_write_buffer_size() + len(line) > self._limits.backlog:
            return False
        self._write(transport, line)
        return True

    def pulse(self, line: bytes) -> None:
        """Send a pulse, or count it as lost; cut the client off when it stays behind."""
        now = self._clock()
        if self.say(line):
            self._sent += 1
            self._behind = 0
            self._kept_up = now
            return
        if self._closing:
            return
        if self._behind == 0:
            self._kept_up = now
        self._dropped += 1
        self._behind += 1
        if now - self._kept_up > self._limits.cut_off:
            _log.warning("client %s (%s) does not read its pulses: cut off", self.name, self.address)
            self.end("slow", "pulses were not read")

    def end(self, code: str, text: str) -> None:
        """Close the connection, telling the client why if it listens."""
        transport = self._transport
        if transport is None or transport.is_closing():
            return
        if not transport.get_write_buffer_size():
            self._write(transport, encode(Refusal(code, text)))
        if transport.get_write_buffer_size():
            transport.abort()  # it does not read: a polite close would wait for it
        else:
            transport.close()

    @property
    def _closing(self) -> bool:
        return self._transport is None or self._transport.is_closing()

    def _take(self, line: bytes) -> None:
        if self._seals is not None:
            try:
                line = self._seals.client.opened(line)
            except SealError as error:
                self._errors += 1
                self.end("sealed", str(error))
                return
        elif self._door is not None:
            self._prove(self._door, line)
            return
        try:
            match parse_client_line(line):
                case Ping(sent):
                    self.say(encode(Pong(sent, self._clock())))
                case Who():
                    self._tell_who()
                case Hello() as hello:
                    self._hub.hello(self, hello)
                case Prove():
                    self._errors += 1
                    self.say(encode(Refusal("malformed", "nobody has asked who you are")))
        except ProtocolError as error:
            self._errors += 1
            self.say(encode(Refusal(error.code, str(error))))

    def _prove(self, door: Door, line: bytes) -> None:
        proven = door.prove(self, line)
        if proven is not None:
            self.user, self._seals = proven
            self._hub.joined(self)

    def _tell_who(self) -> None:
        """Say who else is there: a long line, and so only to who has read all that was said."""
        others = [it for it in self._hub.clients() if it.address != self.address]
        line = encode(Clients(tuple(Listener(it.name, it.behind) for it in others)))
        if self._transport is not None and not self._transport.get_write_buffer_size():
            self._write(self._transport, line)

    def _write(self, transport: asyncio.Transport, lines: bytes) -> None:
        transport.write(lines if self._seals is None else self._seals.server.sealed(lines))


def _tune(connection: socket.socket, cut_off: float) -> None:
    """Let the kernel hold little for a slow client, and notice one that has vanished without a word."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if hasattr(socket, "TCP_USER_TIMEOUT"):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, max(1, int(cut_off * 1000)))
    if hasattr(socket, "TCP_KEEPIDLE"):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, _KEEPALIVE)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 1)
