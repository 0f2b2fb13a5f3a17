"""Fair share of viewer slots: when none is free, a client with fewer takes one of the client with the most.

A client is a token, with all its sessions, addresses and players, or an address where there are no tokens.
While slots are free no client is limited: behind a proxy all clients have the same address.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from server.http.access.permissions import ClientIdentity


@dataclass(slots=True, eq=False)
class Slot:
    """A slot that a client holds."""

    client: ClientIdentity
    stream: str
    end: Callable[[], None]
    """Ends the slot's stream; the slot is released when that has ended."""
    weight: int = 1
    """The number of slots that it counts as."""


class FairShare:
    """The slots that clients hold."""

    def __init__(self) -> None:
        self._held: dict[Slot, None] = {}
        """In order of time, the newest last."""
        self._ending: dict[Slot, None] = {}

    @property
    def all(self) -> int:
        """The number of slots held."""
        return sum(slot.weight for slot in self._held)

    def ending(self, streams: Collection[str] | None = None) -> int:
        """Return the number of slots evicted but not released yet, of some streams or of all."""
        return sum(slot.weight for slot in self._ending if streams is None or slot.stream in streams)

    def take(self, slot: Slot) -> Slot:
        """Register a slot; the caller calls :meth:`release` at the end."""
        self._held[slot] = None
        return slot

    def release(self, slot: Slot) -> None:
        """Free a slot."""
        self._held.pop(slot, None)
        self._ending.pop(slot, None)

    def evict_stream_for(self, client: ClientIdentity) -> bool:
        """Evict all slots of one stream in favor of a client; return whether one was evicted.

        As :meth:`evict_for`, with streams instead of slots: a stream is held by the client whose slot is its
        oldest.
        """
        holders: dict[str, ClientIdentity] = {}
        for slot in self._held:
            holders.setdefault(slot.stream, slot.client)
        most = _most_beyond_share(client, Counter(holders.values()))
        if most is None:
            return False
        newest = next(stream for stream in reversed(holders) if holders[stream].key == most)
        for slot in [slot for slot in self._held if slot.stream == newest]:
            self._evict(slot)
        return True

    def evict_for(self, client: ClientIdentity, streams: Collection[str] | None = None) -> bool:
        """Evict a slot in favor of a client, of some streams or of any; return whether one was evicted.

        It is the newest slot of the client that holds the most, if that holds at least two more than this
        client, so that two clients do not evict each other in turn. Operators are evicted only for other
        operators, and evict other clients however many slots they hold.
        """
        held = [slot for slot in self._held if streams is None or slot.stream in streams]
        counts = Counter[ClientIdentity]()
        for slot in held:
            counts[slot.client] += slot.weight
        most = _most_beyond_share(client, counts)
        if most is None:
            return False
        self._evict(next(slot for slot in reversed(held) if slot.client.key == most))
        return True

    def _evict(self, slot: Slot) -> None:
        del self._held[slot]
        self._ending[slot] = None
        slot.end()


def _most_beyond_share(client: ClientIdentity, held: Mapping[ClientIdentity, int]) -> str | None:
    """Return the client that loses something to another one; None: nobody holds more than their share."""
    counts, operators = Counter[str](), {holder.key for holder in held if holder.is_operator}
    for holder, count in held.items():
        counts[holder.key] += count
    own_count = counts.pop(client.key, 0)
    candidates = {key: count for key, count in counts.items() if key not in operators}
    if not (client.is_operator and candidates):
        evictable = counts if client.is_operator else candidates
        candidates = {key: count for key, count in evictable.items() if count > own_count + 1}
    return max(candidates, key=candidates.__getitem__) if candidates else None
