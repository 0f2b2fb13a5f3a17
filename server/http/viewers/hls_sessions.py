"""HLS sessions: HLS players hold no connection, so those that have fetched recently count as viewers."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple

from aiohttp import web

from server.http.access.permissions import ClientIdentity
from server.http.viewers.fair_share import FairShare, Slot

_TIMEOUT_TARGETS = 3
"""Target durations without a request after which a player has left; it should fetch once in each."""


class HlsClient(NamedTuple):
    """The identity of a player that fetches a stream."""

    stream: str
    client: ClientIdentity
    address: str
    agent: str
    """The User-Agent header: there may be several players behind one address."""


@dataclass(slots=True)
class _Session:
    until: float
    slot: Slot
    evicted: bool = False
    """Whether its slot was evicted: it needs another one."""
    waiting: Counter[str] = field(default_factory=Counter)
    """Blocking requests that are not answered yet, by kind."""

    @property
    def weight(self) -> int:
        """The number of players that it must be: each blocks on one request of a kind at a time."""
        return max(1, max(self.waiting.values(), default=0))


class HlsSessions:
    """Counts HLS players and holds their slots; ``clock`` is monotonic, in seconds.

    ``blocking_kind`` is the kind of data that a blocking request waits for; None: it does not block. More
    requests of one kind than before mean another player behind the same client.
    """

    def __init__(
        self, target_s: float, slots: FairShare, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._timeout_s, self._slots, self._clock = _TIMEOUT_TARGETS * target_s, slots, clock
        self._sessions: dict[HlsClient, _Session] = {}
        """In order of their last request, the newest last."""
        self._by_stream: Counter[str] = Counter()

    @property
    def all(self) -> int:
        """The number of players of all streams."""
        self._expire()
        return self._by_stream.total()

    def of(self, stream: str) -> int:
        """Return the number of players of a stream."""
        self._expire()
        return self._by_stream[stream]

    def is_new_viewer(self, client: HlsClient, blocking_kind: str | None) -> bool:
        """Return whether a request adds a viewer."""
        self._expire()
        known = self._sessions.get(client)
        return known is None or (blocking_kind is not None and known.waiting[blocking_kind] >= known.weight)

    @contextmanager
    def request(self, client: HlsClient, blocking_kind: str | None) -> Iterator[None]:
        """Count a player while a request is answered, and until its timeout afterwards."""
        session = self._change(client, self._sessions.get(client), blocking_kind, 1)
        try:
            yield
        finally:
            if not session.evicted:
                self._change(client, session, blocking_kind, -1)

    def _change(
        self, client: HlsClient, known: _Session | None, blocking_kind: str | None, by: int
    ) -> _Session:
        previous = self._sessions.pop(client, None)
        before = 0 if previous is None else previous.weight
        session = previous or known or self._new(client)
        if blocking_kind is not None:
            session.waiting[blocking_kind] += by
        session.until = self._clock() + self._timeout_s
        session.slot.weight = session.weight
        self._slots.take(session.slot)
        self._sessions[client] = session
        self._by_stream[client.stream] += session.weight - before
        return session

    def _new(self, client: HlsClient) -> _Session:
        session = _Session(0.0, Slot(client.client, client.stream, lambda: self._evict(client, session)))
        return session

    def _evict(self, client: HlsClient, session: _Session) -> None:
        """Stop counting a player, even if it still waits for an answer."""
        session.evicted = True
        if self._sessions.get(client) is session:
            self._drop(client)

    def _drop(self, client: HlsClient) -> None:
        session = self._sessions.pop(client)
        self._slots.release(session.slot)
        self._by_stream[client.stream] -= session.weight
        if not self._by_stream[client.stream]:
            del self._by_stream[client.stream]

    def _expire(self) -> None:
        """Drop players that have timed out; one that waits for an answer stays."""
        now = self._clock()
        while self._sessions:
            client, oldest = next(iter(self._sessions.items()))
            if oldest.until > now:
                return
            if not any(oldest.waiting.values()):
                self._drop(client)
                continue
            del self._sessions[client]
            oldest.until = now + self._timeout_s
            self._sessions[client] = oldest


HLS_SESSIONS = web.AppKey("hls sessions", HlsSessions)
