"""Sharing places out: where none is left, whoever holds fewer gets one of whoever holds the most.

Streams are shared out by token, however many sign-ins, addresses and players it comes by; where there are no
tokens, by address. As long as there is place nobody's share is bounded: behind a proxy all are one address.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass

from server.http.access.grants import ShareHolder


@dataclass(slots=True, eq=False)
class Place:
    """What somebody holds."""

    holder: ShareHolder
    stream: str
    end: Callable[[], None]
    """Takes it away from them; it is given up when that is done."""
    weight: int = 1
    """How many it counts for."""


class Shares:
    """Who holds what."""

    def __init__(self) -> None:
        self._held: dict[Place, None] = {}
        """Who has come last is the last."""
        self._ending: dict[Place, None] = {}

    @property
    def all(self) -> int:
        """How many places are held."""
        return sum(it.weight for it in self._held)

    def ending(self, streams: Collection[str] | None = None) -> int:
        """Return how many were taken away and are not given up yet; of some streams, or of all."""
        return sum(it.weight for it in self._ending if streams is None or it.stream in streams)

    def take(self, place: Place) -> Place:
        """Note that somebody holds a place; call :meth:`give_up` in the end."""
        self._held[place] = None
        return place

    def give_up(self, place: Place) -> None:
        """Note that nobody holds it any more."""
        self._held.pop(place, None)
        self._ending.pop(place, None)

    def make_room(self, holder: ShareHolder, streams: Collection[str] | None = None) -> bool:
        """Take a place away for somebody who has come; of some streams, or any. Tell whether there was one.

        It is the newest one of whoever holds the most, and at least two more than who has come: so no two
        take them away from each other by turns. Of operators nothing is taken away, but for each other; and
        they take from others however many they hold.
        """
        held = [it for it in self._held if streams is None or it.stream in streams]
        counts, operate = Counter[str](), {it.holder.key for it in held if it.holder.operates}
        for it in held:
            counts[it.holder.key] += it.weight
        own = counts.pop(holder.key, 0)
        watch = {key: count for key, count in counts.items() if key not in operate}
        if not (holder.operates and watch):
            among = counts if holder.operates else watch
            watch = {key: count for key, count in among.items() if count > own + 1}
        if not watch:
            return False
        most = max(watch, key=watch.__getitem__)
        newest = next(it for it in reversed(held) if it.holder.key == most)
        del self._held[newest]
        self._ending[newest] = None
        newest.end()
        return True
