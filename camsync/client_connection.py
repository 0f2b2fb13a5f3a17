"""The server's end of one client's connection."""

from __future__ import annotations

import asyncio
import logging
import socket
import ssl
from dataclasses import dataclass
from typing import Protocol, cast

from camsync.clock import Clock
from camsync.limits import ServerLimits
from camsync.lines import LineBuffer, OverlongLineError, RateLimit
from camsync.login import LoginGate
from camsync.messages import (
    ClientList,
    ClientsRequest,
    ErrorMessage,
    Hello,
    ListedClient,
    LoginMessage,
    Ping,
    Pong,
)
from camsync.protocol import MAX_LINE, ProtocolError, encode, parse_client_line

_log = logging.getLogger(__name__)
# In the kernel: a slow client is noticed within seconds, not after an hour of pulses.
_SEND_BUFFER = 4096  # bytes
_KEEPALIVE = 5  # seconds of silence before TCP keepalive probes
# Seconds for a client to read why it is disconnected, except if it does not read, or the server ends.
_LINGER_S, _AT_ONCE = 2.0, ("slow", "stopped")


@dataclass(frozen=True, slots=True)
class ClientInfo:
    """State of one client."""

    name: str | None
    """The name in its HELLO; None before that."""
    address: str
    """``host:port``."""
    joined: float
    """When it connected: unix seconds, server clock."""
    sent: int
    """Pulses handed to its connection."""
    dropped: int
    """Pulses dropped because it did not read."""
    dropped_in_a_row: int
    """Pulses dropped since the last one sent: 0 for a client that keeps up."""
    errors: int
    """Lines received from it that could not be parsed."""


class ConnectionOwner(Protocol):
    """Receiver of a connection's events."""

    def joined(self, client: ClientConnection) -> None:
        """Add a new connection."""

    def left(self, client: ClientConnection) -> None:
        """Remove a connection that has ended."""

    def clients(self) -> tuple[ClientInfo, ...]:
        """Return all clients in the order in which they joined."""

    def hello(self, client: ClientConnection, hello: Hello) -> None:
        """Register a client's name; raise ProtocolError if it may not use it."""


class ClientConnection(asyncio.Protocol):
    """One client. The server never waits for it; its input rate and its output buffer are bounded.

    Where there is a ``gate``, it is registered after the TLS handshake (with ``tls``) and its login.
    """

    def __init__(
        self,
        owner: ConnectionOwner,
        clock: Clock,
        limits: ServerLimits,
        gate: LoginGate | None = None,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        self._owner = owner
        self._gate = gate
        self._tls = tls
        self._clock = clock
        self._limits = limits
        self._lines = LineBuffer(MAX_LINE)
        self._joined_at = clock()
        self._rate = RateLimit(limits.line_burst, limits.line_rate, self._joined_at)
        self._last_sent_at = self._joined_at
        self._transport: asyncio.Transport | None = None
        self._handshake: asyncio.Task[None] | None = None
        self._sent = self._dropped = self._dropped_in_a_row = self._errors = 0
        self._is_registered = self._is_list_due = False
        self._early_lines: list[bytes] = []
        """Lines that arrived with the end of the TLS handshake."""
        self.address = self._host = "?"
        self.name: str | None = None
        self.user: str | None = None
        """The user that has logged in; None where no login is needed."""

    @property
    def user_or_host(self) -> str:
        """The user that has logged in, or else the host."""
        return self.user or self._host

    def info(self) -> ClientInfo:
        """Return the state of this client now."""
        return ClientInfo(
            self.name,
            self.address,
            self._joined_at,
            self._sent,
            self._dropped,
            self._dropped_in_a_row,
            self._errors,
        )

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Start serving the client (called by asyncio)."""
        self._transport = cast("asyncio.Transport", transport)
        self._host, port, *_ = transport.get_extra_info("peername") or ("?", 0)
        self.address = f"{self._host}:{port}"
        _tune(transport.get_extra_info("socket"), self._limits.cut_off)
        if self._gate is None:
            self._register()
            return
        self._gate.hold(self)
        if self._tls is None:
            self._request_login(self._gate)
        else:
            self._transport.pause_reading()  # bytes that have arrived already belong to TLS
            self._handshake = asyncio.create_task(
                self._start_tls(self._tls, self._gate), name="TLS of pulses"
            )

    def data_received(self, data: bytes) -> None:
        """Parse and answer the client's lines (called by asyncio)."""
        try:
            for line in self._lines.feed(data):
                if self._is_closing:
                    return
                if not self._rate.take(self._clock()):
                    self.end("flood", "too many lines")
                    return
                self._handle_line(line)
        except OverlongLineError as error:
            self._errors += 1
            self.end("overlong", str(error))

    def eof_received(self) -> bool:
        """Keep sending to a client that closed its sending side, such as ``nc`` (called by asyncio).

        A client that has sent HELLO is closed: otherwise a camera that is gone would still count as
        connected. TLS closes both directions at once.
        """
        return self.name is None and self._tls is None

    def connection_lost(self, exc: Exception | None) -> None:
        """Remove the client (called by asyncio)."""
        _log.debug("client %s (%s) left: %s", self.name, self.address, exc or "closed")
        self._transport = None
        if self._handshake is not None:
            self._handshake.cancel()
        if self._gate is not None:
            self._gate.forget(self)
        self._owner.left(self)

    def send(self, line: bytes) -> bool:
        """Send a line unless ``limits.backlog`` bytes are waiting; return whether it was sent."""
        transport = self._transport
        if transport is None or transport.is_closing():
            return False
        if transport.get_write_buffer_size() + len(line) > self._limits.backlog:
            return False
        transport.write(line)
        return True

    def send_pulse(self, line: bytes) -> None:
        """Send a pulse, or count it as dropped; close the connection of a client that stays behind."""
        if self._is_list_due:
            self._send_clients()
        now = self._clock()
        if self.send(line):
            self._sent += 1
            self._dropped_in_a_row = 0
            self._last_sent_at = now
            return
        if self._is_closing:
            return
        if self._dropped_in_a_row == 0:
            self._last_sent_at = now
        self._dropped += 1
        self._dropped_in_a_row += 1
        if now - self._last_sent_at > self._limits.cut_off:
            _log.warning("client %s (%s) does not read its pulses: disconnected", self.name, self.address)
            self.end("slow", "pulses were not read")

    def end(self, code: str, text: str) -> None:
        """Close the connection with an ERROR line, for which a client that is behind has a moment."""
        transport = self._transport
        if transport is None or transport.is_closing():
            return
        if self._handshake is not None and not self._handshake.done():
            transport.abort()  # no line can be sent before TLS is ready
            return
        transport.write(encode(ErrorMessage(code, text)))
        transport.close()
        if transport.get_write_buffer_size():  # close() would wait for the client, whether it reads or not
            if code in _AT_ONCE:
                transport.abort()
            else:
                asyncio.get_running_loop().call_later(_LINGER_S, transport.abort)

    @property
    def _is_closing(self) -> bool:
        return self._transport is None or self._transport.is_closing()

    async def _start_tls(self, tls: ssl.SSLContext, gate: LoginGate) -> None:
        if (plain := self._transport) is None:
            return
        try:
            encrypted = await asyncio.get_running_loop().start_tls(
                plain, self, tls, server_side=True, ssl_handshake_timeout=self._limits.login_within
            )
        except OSError as error:  # includes ssl.SSLError
            _log.debug("client %s: no TLS: %s", self.address, error)
            self._transport = None
            gate.refuse(self, "TLS failed")
            return
        if encrypted is not None:
            self._transport = encrypted
            asyncio.get_running_loop().call_soon(self._request_login, gate)  # by then the handshake is done

    def _request_login(self, gate: LoginGate) -> None:
        self._handshake = None
        if not gate.send_login_request(self) and not self._is_closing:
            self._register()
        for line in self._early_lines:
            if not self._is_closing:
                self._handle_line(line)
        self._early_lines.clear()

    def _register(self) -> None:
        self._is_registered = True
        self._owner.joined(self)

    def _handle_line(self, line: bytes) -> None:
        if self._handshake is not None:
            self._early_lines.append(line)
            return
        if not self._is_registered:
            if self._gate is not None and (user := self._gate.log_in(self, line)) is not None:
                self.user = user
                self._register()
            return
        try:
            match parse_client_line(line):
                case Ping(sent):
                    self.send(encode(Pong(sent, self._clock())))
                case ClientsRequest():
                    self._send_clients()
                case Hello() as hello:
                    self._owner.hello(self, hello)
                case LoginMessage():
                    self.send(encode(ErrorMessage("malformed", "this connection needs no login")))
        except ProtocolError as error:
            self._errors += 1
            self.send(encode(ErrorMessage(error.code, str(error))))

    def _send_clients(self) -> None:
        """Send the list of the other clients: a long line, so only once a client has read everything else."""
        transport = self._transport
        self._is_list_due = transport is not None and transport.get_write_buffer_size() > 0
        if transport is None or self._is_list_due:
            return
        listed = tuple(
            ListedClient(client.name, client.dropped_in_a_row)
            for client in self._owner.clients()
            if client.address != self.address
        )
        transport.write(encode(ClientList(listed)))


def _tune(connection: socket.socket, cut_off: float) -> None:
    """Set a small send buffer for slow clients, and keepalive to detect clients that have vanished."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if hasattr(socket, "TCP_USER_TIMEOUT"):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, max(1, int(cut_off * 1000)))
    if hasattr(socket, "TCP_KEEPIDLE"):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, _KEEPALIVE)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 1)
