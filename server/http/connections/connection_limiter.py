"""Connection pool: which connections are kept, and which are closed in favor of others.

A connection is *receiving* until its request is complete, *busy* while that is answered, then *idle*. Busy
ones are kept. Of the others the one that has waited longest is closed where the pool is full, and each is
closed that waits for too long. Where all are busy, a few connections are reserved for operators.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol

from server.http.access.networks import is_loopback, network_of

_STALLED_S = 60.0
"""An answer of which the client has taken nothing for so long is given up."""


class ConnectionTransport(Protocol):
    """What a connection sends over: a transport, or a socket that is being accepted."""

    def abort(self) -> None:
        """Close it at once."""

    def get_write_buffer_size(self) -> int:
        """Return how many bytes the client has not taken yet."""


@dataclass(slots=True, eq=False)
class Connection:
    """A connection, from when it is accepted until it is closed."""

    transport: ConnectionTransport
    network: str
    is_reserved: bool = False
    """It holds one of the connections that are reserved for operators."""
    closed: bool = False


@dataclass(frozen=True, slots=True)
class ConnectionLimits:
    """How many connections there may be, and for how many seconds they may do nothing."""

    most: int
    per_address: int
    """Of one address, this machine's own excepted."""
    for_operators: int
    """Reserved ones beyond ``most``."""
    request_s: float
    """Until a request is complete."""
    keepalive_s: float
    """Until the next request."""


Queue = dict[Connection, float]
"""Connections and since when they wait, the longest first."""


@dataclass(slots=True)
class _Pool:
    """Connections of one kind: ordinary or reserved ones."""

    open: int = 0
    receiving: Queue = field(default_factory=dict)
    idle: Queue = field(default_factory=dict)

    def longest_waiting(self) -> Connection | None:
        """Return the connection to close first: of the longer queue, so that neither crowds out the other."""
        return next(iter(self.receiving if len(self.receiving) >= len(self.idle) else self.idle), None)


class ConnectionLimiter:
    """Admits connections and follows their states; ``clock`` is in seconds and never steps."""

    def __init__(self, limits: ConnectionLimits, clock: Callable[[], float] = time.monotonic) -> None:
        self.limits = limits
        self._clock = clock
        self._ordinary, self._reserved = _Pool(), _Pool()
        self._per_network: Counter[str] = Counter()
        self._waiting: defaultdict[str, dict[Connection, None]] = defaultdict(dict)
        """By network, its ordinary connections that are not busy, the longest waiting first."""
        self._sending: dict[Connection, tuple[int, float]] = {}
        """By connection that is sent an answer: how much of it is left, and since when it is as much."""

    @property
    def open(self) -> int:
        """How many connections are open, reserved ones among them."""
        return self._ordinary.open + self._reserved.open

    def admit(self, address: str, transport: ConnectionTransport) -> Connection | None:
        """Admit a connection, closing another where the pool is full; None: all others are busy."""
        it = Connection(transport, network_of(address))
        if not is_loopback(address) and self._per_network[it.network] >= self.limits.per_address:
            evicted = next(iter(self._waiting[it.network]), None)
            it.is_reserved = evicted is None
        elif self._ordinary.open >= self.limits.most:
            evicted = self._ordinary.longest_waiting()
            it.is_reserved = evicted is None
        else:
            evicted = None
        if it.is_reserved and self._reserved.open >= self.limits.for_operators:
            evicted = _of_largest_network(self._reserved.receiving, it) or _of_largest_network(
                self._reserved.idle, it
            )
            if evicted is None:
                return None
        if evicted is not None:
            self._close(evicted)
        self._pool(it).open += 1
        if not it.is_reserved:
            self._per_network[it.network] += 1
        self.receiving(it)
        return it

    def evict_waiting(self) -> None:
        """Close a connection that is not busy: the system is short of file descriptors or memory."""
        it = self._ordinary.longest_waiting()
        if it is not None:
            self._close(it)

    def receiving(self, it: Connection) -> None:
        """Note that a connection's request is not complete: its head or its body is to come."""
        self._queue(it, self._pool(it).receiving)

    def busy(self, it: Connection) -> None:
        """Note that a connection's request is complete and being answered."""
        self._unqueue(it)

    def sending(self, it: Connection) -> None:
        """Note that a connection's answer is being sent, and has to be taken by the client."""
        if not it.closed:
            self._sending[it] = it.transport.get_write_buffer_size(), self._clock()

    def idle(self, it: Connection) -> None:
        """Note that a connection's answer is complete."""
        self._queue(it, self._pool(it).idle)

    def closed(self, it: Connection) -> None:
        """Note that a connection is closed."""
        if it.closed:
            return
        self._unqueue(it)
        it.closed = True
        self._pool(it).open -= 1
        if not it.is_reserved:
            self._per_network[it.network] -= 1
            if not self._per_network[it.network]:
                del self._per_network[it.network]
                self._waiting.pop(it.network, None)

    def close_overdue(self) -> None:
        """Close connections that have waited for too long, or whose client takes nothing of its answer."""
        now, limits = self._clock(), self.limits
        for pool in (self._ordinary, self._reserved):
            for queue, most in ((pool.receiving, limits.request_s), (pool.idle, limits.keepalive_s)):
                while queue and now - next(iter(queue.values())) >= most:
                    self._close(next(iter(queue)))
        for it, (unsent, since) in list(self._sending.items()):
            left = it.transport.get_write_buffer_size()
            if left != unsent or not left:
                self._sending[it] = left, now
            elif now - since >= _STALLED_S:
                self._close(it)

    def _close(self, it: Connection) -> None:
        self.closed(it)
        it.transport.abort()

    def _pool(self, it: Connection) -> _Pool:
        return self._reserved if it.is_reserved else self._ordinary

    def _queue(self, it: Connection, queue: Queue) -> None:
        self._unqueue(it)
        if it.closed:
            return
        queue[it] = self._clock()
        if not it.is_reserved:
            self._waiting[it.network][it] = None

    def _unqueue(self, it: Connection) -> None:
        pool = self._pool(it)
        pool.receiving.pop(it, None)
        pool.idle.pop(it, None)
        self._sending.pop(it, None)
        if not it.is_reserved and it.network in self._waiting:
            self._waiting[it.network].pop(it, None)


def _of_largest_network(queue: Iterable[Connection], new: Connection) -> Connection | None:
    """Return the longest waiting connection of the network that has the most of them and of the new one."""
    waiting = list(queue)
    count = Counter(it.network for it in (*waiting, new))
    return max(waiting, key=lambda it: count[it.network], default=None)  # the first of equals
