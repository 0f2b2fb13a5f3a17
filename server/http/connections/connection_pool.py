"""Who has a place among the connections, and who makes way for others: whoever asks for nothing.

A connection is *silent* until what it asks for has come whole, *busy* while that is answered, then *resting*.
Busy ones keep their places. Of the others the one that has waited longest makes way where no place is left,
and each is cut off that waits for too long. Where all are busy, there are a few places beyond, for operators.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol

from server.http.access.networks import is_loopback, network_of

_STALLED_S = 60.0
"""An answer of which nothing was taken for so long is taken by nobody."""


class Wire(Protocol):
    """What a connection is made of: a transport, or what becomes one."""

    def abort(self) -> None:
        """End it at once."""

    def get_write_buffer_size(self) -> int:
        """Return how many bytes the other side has not taken yet."""


@dataclass(slots=True, eq=False)
class Connection:
    """A connection, from when it is accepted until it is gone."""

    wire: Wire
    network: str
    beyond: bool = False
    """It has no place but one of those that are kept for operators."""
    gone: bool = False


@dataclass(frozen=True, slots=True)
class Bounds:
    """How many connections there may be, and for how many seconds they may keep quiet."""

    most: int
    per_address: int
    """Of one address, this machine's own excepted."""
    for_operators: int
    """Beyond ``most``."""
    request_s: float
    """Until what is asked for has come whole."""
    keepalive_s: float
    """Until something more is asked for."""


Queue = dict[Connection, float]
"""Connections and since when they wait, the longest first."""


@dataclass(slots=True)
class _Pool:
    """Places of one kind."""

    taken: int = 0
    silent: Queue = field(default_factory=dict)
    resting: Queue = field(default_factory=dict)

    def longest(self) -> Connection | None:
        """Return who makes way: of the larger queue, so that neither kind can be pushed out by the other."""
        return next(iter(self.silent if len(self.silent) >= len(self.resting) else self.resting), None)


class Places:
    """Gives places to connections; ``clock`` is in seconds, and never steps."""

    def __init__(self, bounds: Bounds, clock: Callable[[], float] = time.monotonic) -> None:
        self.bounds = bounds
        self._clock = clock
        self._all, self._beyond = _Pool(), _Pool()
        self._of: Counter[str] = Counter()
        self._quiet: defaultdict[str, dict[Connection, None]] = defaultdict(dict)
        """By network, those of them that have a place and are not busy, the longest first."""
        self._sent: dict[Connection, tuple[int, float]] = {}
        """To whom an answer is sent: how much of it is left, and since when it is as much."""

    @property
    def taken(self) -> int:
        """How many there are, those beyond among them."""
        return self._all.taken + self._beyond.taken

    def admit(self, address: str, wire: Wire) -> Connection | None:
        """Give a place to somebody who comes, another's where there is none; None: nobody makes way."""
        it = Connection(wire, network_of(address))
        if not is_loopback(address) and self._of[it.network] >= self.bounds.per_address:
            makes_way = next(iter(self._quiet[it.network]), None)
            it.beyond = makes_way is None
        elif self._all.taken >= self.bounds.most:
            makes_way = self._all.longest()
            it.beyond = makes_way is None
        else:
            makes_way = None
        if it.beyond and self._beyond.taken >= self.bounds.for_operators:
            makes_way = _of_most(self._beyond.silent, it) or _of_most(self._beyond.resting, it)
            if makes_way is None:
                return None
        if makes_way is not None:
            self._cut_off(makes_way)
        self._pool(it).taken += 1
        if not it.beyond:
            self._of[it.network] += 1
        self.waits(it)
        return it

    def make_way(self) -> None:
        """Cut somebody off who asks for nothing: the system is short of what connections are made of."""
        it = self._all.longest()
        if it is not None:
            self._cut_off(it)

    def waits(self, it: Connection) -> None:
        """Note that what a connection asks for is yet to come: a head, or what follows it."""
        self._queue(it, self._pool(it).silent)

    def asks(self, it: Connection) -> None:
        """Note that it is being answered, and keeps its place."""
        self._unqueue(it)

    def is_sent(self, it: Connection) -> None:
        """Note that its answer is there, and has to be taken."""
        if not it.gone:
            self._sent[it] = it.wire.get_write_buffer_size(), self._clock()

    def rests(self, it: Connection) -> None:
        """Note that it has its answer."""
        self._queue(it, self._pool(it).resting)

    def left(self, it: Connection) -> None:
        """Free its place."""
        if it.gone:
            return
        self._unqueue(it)
        it.gone = True
        self._pool(it).taken -= 1
        if not it.beyond:
            self._of[it.network] -= 1
            if not self._of[it.network]:
                del self._of[it.network]
                self._quiet.pop(it.network, None)

    def cut_off_overdue(self) -> None:
        """End those that have waited for too long, or take nothing of their answers."""
        now, bounds = self._clock(), self.bounds
        for pool in (self._all, self._beyond):
            for queue, patience in ((pool.silent, bounds.request_s), (pool.resting, bounds.keepalive_s)):
                while queue and now - next(iter(queue.values())) >= patience:
                    self._cut_off(next(iter(queue)))
        for it, (unsent, since) in list(self._sent.items()):
            left = it.wire.get_write_buffer_size()
            if left != unsent or not left:
                self._sent[it] = left, now
            elif now - since >= _STALLED_S:
                self._cut_off(it)

    def _cut_off(self, it: Connection) -> None:
        self.left(it)
        it.wire.abort()

    def _pool(self, it: Connection) -> _Pool:
        return self._beyond if it.beyond else self._all

    def _queue(self, it: Connection, queue: Queue) -> None:
        self._unqueue(it)
        if it.gone:
            return
        queue[it] = self._clock()
        if not it.beyond:
            self._quiet[it.network][it] = None

    def _unqueue(self, it: Connection) -> None:
        pool = self._pool(it)
        pool.silent.pop(it, None)
        pool.resting.pop(it, None)
        self._sent.pop(it, None)
        if not it.beyond and it.network in self._quiet:
            self._quiet[it.network].pop(it, None)


def _of_most(queue: Iterable[Connection], comes: Connection) -> Connection | None:
    """Return the one that has waited longest, of the network that has the most of them and of who comes."""
    waiting = list(queue)
    count = Counter(it.network for it in (*waiting, comes))
    return max(waiting, key=lambda it: count[it.network], default=None)  # the first of equals
