"""The clients of a pulse server."""

from __future__ import annotations

import logging
import ssl
from collections import defaultdict
from collections.abc import Callable, Collection

from camsync.client_connection import ClientConnection, ClientInfo
from camsync.clock import Clock
from camsync.limits import ServerLimits, select_evicted
from camsync.login import LoginGate
from camsync.messages import Hello
from camsync.protocol import ProtocolError
from logthrottle import LogThrottle

_log = logging.getLogger(__name__)


class ClientRegistry:
    """The connected clients.

    A place is reserved for each of the ``reserved`` names. All other connections share ``limits.clients``
    places, those of one login no more than ``limits.login_places`` of them.

    ``gate`` holds connections back until they have logged in; ``greet`` returns the first lines for a new
    client; ``on_hello`` is called with every HELLO that was accepted, ``on_change`` when a client got a name
    or left.
    """

    def __init__(
        self,
        clock: Clock,
        limits: ServerLimits,
        greet: Callable[[], bytes],
        on_hello: Callable[[Hello], None],
        on_change: Callable[[], None],
        gate: LoginGate | None = None,
        tls: ssl.SSLContext | None = None,
        reserved: Collection[str] = (),
    ) -> None:
        self._gate = gate
        self._tls = tls
        self._reserved = frozenset(reserved)
        self._clock = clock
        self._limits = limits
        self._greet = greet
        self._on_hello = on_hello
        self._on_change = on_change
        self._connections: dict[int, ClientConnection] = {}  # by id(), in the order of joining
        self._closed = False
        self._arrivals: dict[str, LogThrottle] = defaultdict(lambda: LogThrottle(clock))  # of reserved names
        self._other_arrivals, self._evictions = LogThrottle(clock), LogThrottle(clock)

    def new_connection(self) -> ClientConnection:
        """Build the protocol object of a new connection (asyncio's factory)."""
        return ClientConnection(self, self._clock, self._limits, self._gate, self._tls)

    def clients(self) -> tuple[ClientInfo, ...]:
        """Return all clients in the order in which they joined."""
        return tuple(client.info() for client in self._connections.values())

    def names(self) -> frozenset[str]:
        """Return the names of the connected clients that have sent HELLO."""
        return frozenset(client.name for client in self._connections.values() if client.name is not None)

    def send_pulse(self, line: bytes) -> None:
        """Send a pulse to all clients without waiting."""
        for client in tuple(self._connections.values()):
            client.send_pulse(line)

    def broadcast(self, line: bytes) -> None:
        """Send a line to all clients that keep up."""
        for client in tuple(self._connections.values()):
            client.send(line)

    def close(self) -> None:
        """End all connections, also those that are still logging in."""
        self._closed = True
        if self._gate is not None:
            self._gate.close()
        for client in tuple(self._connections.values()):
            client.end("stopped", "the server stops")

    def joined(self, client: ClientConnection) -> None:
        """Greet a new connection; of too many, close the oldest of the user or host that has the most."""
        if self._closed:
            client.end("stopped", "the server stops")
            return
        self._make_room(client)
        self._connections[id(client)] = client
        client.send(self._greet())

    def left(self, client: ClientConnection) -> None:
        """Remove a connection."""
        if self._connections.pop(id(client), None) is not None and client.name is not None:
            self._on_change()

    def hello(self, client: ClientConnection, hello: Hello) -> None:
        """Name a client; an older client of the same name is replaced, so that a restarted one can connect.

        Raises:
            ProtocolError: the connection has another name or user.
        """
        if client.user not in {None, hello.name}:
            raise ProtocolError("name", f"this connection is for {client.user} alone")
        if client.name not in {None, hello.name}:
            raise ProtocolError("malformed", f"this connection is {client.name} already")
        self._log_arrival(client, hello.name)
        older = [
            other for other in self._connections.values() if other.name == hello.name and other is not client
        ]
        for other in older:
            other.name = None
            other.end("replaced", f"another {hello.name} has connected")
        client.name = hello.name
        self._on_hello(hello)
        self._on_change()

    def _make_room(self, newcomer: ClientConnection) -> None:
        candidates = [client for client in self._connections.values() if client.name not in self._reserved]
        same_user_or_host = [client for client in candidates if client.user_or_host == newcomer.user_or_host]
        if newcomer.user is not None and len(same_user_or_host) >= self._limits.login_places:
            candidates = same_user_or_host
        elif len(candidates) < self._limits.clients:
            return
        evicted = select_evicted(candidates)
        if (more := self._evictions.record(evicted.user_or_host)) is not None:
            message = "%s has %d connections: the oldest is closed for a new one%s"
            count = sum(client.user_or_host == evicted.user_or_host for client in candidates)
            _log.warning(message, evicted.user_or_host, count, more)
        self.left(evicted)
        evicted.end("full", f"too many connections of {evicted.user_or_host}")

    def _log_arrival(self, client: ClientConnection, name: str) -> None:
        """Log an arrival, throttled: two clients of one name may replace each other endlessly."""
        if client.name is not None:  # a repeated HELLO
            return
        before = next((other for other in self._connections.values() if other.name == name), None)
        reserved = name in self._reserved
        throttle = self._arrivals[name] if reserved else self._other_arrivals
        more = throttle.record(("" if before is None else "replaced") if reserved else name)
        if more is None:
            return
        if before is None:
            _log.info("%s connected%s", name, more)
        else:
            _log.warning("another %s connected from %s: the older is closed%s", name, client.address, more)
