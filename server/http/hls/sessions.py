"""Who watches by fetching (HLS): nobody is connected for good, so whoever has asked lately is a viewer."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple

from server.http.access.grants import ShareHolder
from server.http.connections.fair_shares import Place, Shares

_TARGETS = 3
"""Target durations: a player asks once in each; who has not for so many has gone."""


def of_person(number: int) -> str:
    """Name the stream of a person."""
    return f"object {number}"


def of_camera(name: str) -> str:
    """Name the stream of a camera."""
    return f"camera {name}"


def of_live(camera: str) -> str:
    """Name a camera's stream as it is shown at once, over a connection."""
    return f"live {camera}"


def of_decided(camera: str) -> str:
    """Name the stream of a person that is held to a camera."""
    return f"decided {camera}"


class Reader(NamedTuple):
    """Somebody who fetches a stream."""

    stream: str
    holder: ShareHolder
    address: str
    agent: str
    """What the player calls itself: behind one address there may be several."""


@dataclass(slots=True)
class _Kept:
    until: float
    place: Place
    ended: bool = False
    """It was taken away from them: they have to ask for a place anew."""
    awaited: Counter[str] = field(default_factory=Counter)
    """Questions that may have to wait and are not answered yet, by kind."""

    @property
    def weight(self) -> int:
        """How many there are at least: a player waits for one thing of a kind at a time."""
        return max(1, max(self.awaited.values(), default=0))


class Readers:
    """Counts readers, who hold places; the clock is in seconds, and never steps."""

    def __init__(self, target_s: float, shares: Shares, clock: Callable[[], float] = time.monotonic) -> None:
        self._kept_s, self._shares, self._clock = _TARGETS * target_s, shares, clock
        self._readers: dict[Reader, _Kept] = {}
        """Whoever has asked last is the last."""
        self._of: Counter[str] = Counter()

    @property
    def all(self) -> int:
        """How many read, all streams together."""
        self._forget()
        return self._of.total()

    def of(self, stream: str) -> int:
        """How many read a stream."""
        self._forget()
        return self._of[stream]

    def is_one_more(self, reader: Reader, awaits: str | None) -> bool:
        """Whether it is a viewer more who asks now, and may have to wait for something of that kind."""
        self._forget()
        known = self._readers.get(reader)
        return known is None or (awaits is not None and known.awaited[awaits] >= known.weight)

    @contextmanager
    def asking(self, reader: Reader, awaits: str | None) -> Iterator[None]:
        """Count somebody while a question is answered, and for a while after."""
        kept = self._change(reader, self._readers.get(reader), awaits, 1)
        try:
            yield
        finally:
            if not kept.ended:
                self._change(reader, kept, awaits, -1)

    def _change(self, reader: Reader, known: _Kept | None, awaits: str | None, by: int) -> _Kept:
        there = self._readers.pop(reader, None)
        before = 0 if there is None else there.weight
        now = there or known or self._new(reader)
        if awaits is not None:
            now.awaited[awaits] += by
        now.until = self._clock() + self._kept_s
        now.place.weight = now.weight
        self._shares.take(now.place)
        self._readers[reader] = now
        self._of[reader.stream] += now.weight - before
        return now

    def _new(self, reader: Reader) -> _Kept:
        kept = _Kept(0.0, Place(reader.holder, reader.stream, lambda: self._end(reader, kept)))
        return kept

    def _end(self, reader: Reader, kept: _Kept) -> None:
        """Count somebody no more, though they may still wait for an answer."""
        kept.ended = True
        if self._readers.get(reader) is kept:
            self._drop(reader)

    def _drop(self, reader: Reader) -> None:
        kept = self._readers.pop(reader)
        self._shares.give_up(kept.place)
        self._of[reader.stream] -= kept.weight
        if not self._of[reader.stream]:
            del self._of[reader.stream]

    def _forget(self) -> None:
        """Forget who has not asked for long. Whoever waits for an answer is there."""
        now = self._clock()
        while self._readers:
            reader, oldest = next(iter(self._readers.items()))
            if oldest.until > now:
                return
            if not any(oldest.awaited.values()):
                self._drop(reader)
                continue
            del self._readers[reader]
            oldest.until = now + self._kept_s
            self._readers[reader] = oldest
