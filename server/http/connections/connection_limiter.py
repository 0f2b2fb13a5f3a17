"""Connection limiter: admits connections, and closes waiting ones to make room or after a timeout.

A connection is *receiving* until its request is complete, *busy* while that is answered, then *idle*. Busy
connections are kept. When the limit is reached, the receiving or idle connection that has waited longest is
closed. When all are busy, only a few connections reserved for operators are left.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol

from server.http.access.networks import is_loopback, network_of

_STALLED_S = 60.0
"""Seconds without progress after which an answer is broken off: the client reads nothing."""


class ConnectionTransport(Protocol):
    """The transport of a connection, or its socket while it is being accepted."""

    def abort(self) -> None:
        """Close it at once."""

    def get_write_buffer_size(self) -> int:
        """Return the number of bytes not sent to the client yet."""


@dataclass(slots=True, eq=False)
class Connection:
    """A connection from accept to close."""

    transport: ConnectionTransport
    network: str
    is_reserved: bool = False
    """Whether it uses a connection reserved for operators."""
    closed: bool = False


@dataclass(frozen=True, slots=True)
class ConnectionLimits:
    """Limits of the number of connections, and of the seconds that they may wait."""

    most: int
    per_address: int
    """Connections of one address; loopback addresses are not limited."""
    for_operators: int
    """Reserved connections beyond ``most``."""
    request_s: float
    """Time until a request is complete."""
    keepalive_s: float
    """Time until the next request."""


Queue = dict[Connection, float]
"""Waiting connections and the time since which each waits, the longest waiting first."""


@dataclass(slots=True)
class _Pool:
    """Ordinary connections, or reserved ones."""

    open: int = 0
    receiving: Queue = field(default_factory=dict)
    idle: Queue = field(default_factory=dict)

    def longest_waiting(self) -> Connection | None:
        """Return the longest waiting connection of the longer queue, so that neither is starved."""
        return next(iter(self.receiving if len(self.receiving) >= len(self.idle) else self.idle), None)


class ConnectionLimiter:
    """Admits connections and tracks their states; ``clock`` is monotonic, in seconds."""

    def __init__(self, limits: ConnectionLimits, clock: Callable[[], float] = time.monotonic) -> None:
        self.limits = limits
        self._clock = clock
        self._ordinary, self._reserved = _Pool(), _Pool()
        self._per_network: Counter[str] = Counter()
        self._waiting: defaultdict[str, dict[Connection, None]] = defaultdict(dict)
        """By network: its ordinary connections that are not busy, the longest waiting first."""
        self._sending: dict[Connection, tuple[int, float]] = {}
        """Connections whose answers are being sent: unsent bytes, and since when the number is unchanged."""

    @property
    def open(self) -> int:
        """The number of open connections, including reserved ones."""
        return self._ordinary.open + self._reserved.open

    def admit(self, address: str, transport: ConnectionTransport) -> Connection | None:
        """Admit a connection, closing a waiting one if the limit is reached; None: all others are busy."""
        connection = Connection(transport, network_of(address))
        if not is_loopback(address) and self._per_network[connection.network] >= self.limits.per_address:
            evicted = next(iter(self._waiting[connection.network]), None)
            connection.is_reserved = evicted is None
        elif self._ordinary.open >= self.limits.most:
            evicted = self._ordinary.longest_waiting()
            connection.is_reserved = evicted is None
        else:
            evicted = None
        if connection.is_reserved and self._reserved.open >= self.limits.for_operators:
            evicted = _of_largest_network(self._reserved.receiving, connection) or _of_largest_network(
                self._reserved.idle, connection
            )
            if evicted is None:
                return None
        if evicted is not None:
            self._close(evicted)
        self._pool(connection).open += 1
        if not connection.is_reserved:
            self._per_network[connection.network] += 1
        self.receiving(connection)
        return connection

    def evict_waiting(self) -> None:
        """Close the longest waiting connection: the system is short of file descriptors or memory."""
        connection = self._ordinary.longest_waiting()
        if connection is not None:
            self._close(connection)

    def receiving(self, connection: Connection) -> None:
        """Record that a connection's request is incomplete: its head or its body is still to come."""
        self._queue(connection, self._pool(connection).receiving)

    def busy(self, connection: Connection) -> None:
        """Record that a connection's request is complete and being answered."""
        self._unqueue(connection)

    def sending(self, connection: Connection) -> None:
        """Record that a connection's answer is being sent."""
        if not connection.closed:
            self._sending[connection] = connection.transport.get_write_buffer_size(), self._clock()

    def idle(self, connection: Connection) -> None:
        """Record that a connection's answer is complete."""
        self._queue(connection, self._pool(connection).idle)

    def closed(self, connection: Connection) -> None:
        """Record that a connection is closed."""
        if connection.closed:
            return
        self._unqueue(connection)
        connection.closed = True
        self._pool(connection).open -= 1
        if not connection.is_reserved:
            self._per_network[connection.network] -= 1
            if not self._per_network[connection.network]:
                del self._per_network[connection.network]
                self._waiting.pop(connection.network, None)

    def close_overdue(self) -> None:
        """Close connections that have waited too long, or whose client does not read its answer."""
        now, limits = self._clock(), self.limits
        for pool in (self._ordinary, self._reserved):
            for queue, most in ((pool.receiving, limits.request_s), (pool.idle, limits.keepalive_s)):
                while queue and now - next(iter(queue.values())) >= most:
                    self._close(next(iter(queue)))
        for connection, (unsent, since) in list(self._sending.items()):
            left = connection.transport.get_write_buffer_size()
            if left != unsent or not left:
                self._sending[connection] = left, now
            elif now - since >= _STALLED_S:
                self._close(connection)

    def _close(self, connection: Connection) -> None:
        self.closed(connection)
        connection.transport.abort()

    def _pool(self, connection: Connection) -> _Pool:
        return self._reserved if connection.is_reserved else self._ordinary

    def _queue(self, connection: Connection, queue: Queue) -> None:
        self._unqueue(connection)
        if connection.closed:
            return
        queue[connection] = self._clock()
        if not connection.is_reserved:
            self._waiting[connection.network][connection] = None

    def _unqueue(self, connection: Connection) -> None:
        pool = self._pool(connection)
        pool.receiving.pop(connection, None)
        pool.idle.pop(connection, None)
        self._sending.pop(connection, None)
        if not connection.is_reserved and connection.network in self._waiting:
            self._waiting[connection.network].pop(connection, None)


def _of_largest_network(queue: Iterable[Connection], new: Connection) -> Connection | None:
    """Return the longest waiting connection of the network with the most, counting the new one."""
    waiting = list(queue)
    count = Counter(connection.network for connection in (*waiting, new))
    # of equals, max returns the first
    return max(waiting, key=lambda connection: count[connection.network], default=None)
