"""Fair share: where no slot is left, a client with fewer gets one of the client with the most.

A client is a token, however many sessions, addresses and players it has; where there are no tokens, an
address. As long as slots are free no share is limited: behind a proxy all clients have one address.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass

from server.http.access.permissions import ClientIdentity


@dataclass(slots=True, eq=False)
class Slot:
    """What a client holds."""

    client: ClientIdentity
    stream: str
    end: Callable[[], None]
    """Ends what the slot is used for; it is released once that is done."""
    weight: int = 1
    """How many slots it counts as."""


class FairShare:
    """Which client holds which slots."""

    def __init__(self) -> None:
        self._held: dict[Slot, None] = {}
        """The newest last."""
        self._ending: dict[Slot, None] = {}

    @property
    def all(self) -> int:
        """How many slots are held."""
        return sum(it.weight for it in self._held)

    def ending(self, streams: Collection[str] | None = None) -> int:
        """Return how many slots were evicted but not released yet; of some streams, or of all."""
        return sum(it.weight for it in self._ending if streams is None or it.stream in streams)

    def take(self, slot: Slot) -> Slot:
        """Register a slot; call :meth:`release` in the end."""
        self._held[slot] = None
        return slot

    def release(self, slot: Slot) -> None:
        """Free a slot."""
        self._held.pop(slot, None)
        self._ending.pop(slot, None)

    def evict_for(self, client: ClientIdentity, streams: Collection[str] | None = None) -> bool:
        """Evict a slot in favor of a client, of some streams or any; tell whether there was one to evict.

        It is the newest slot of the client that holds the most, if those are at least two more than this
        client's: so no two clients evict each other in turn. Operators are evicted only for other operators;
        and they evict others however many slots they hold.
        """
        held = [it for it in self._held if streams is None or it.stream in streams]
        counts, operators = Counter[str](), {it.client.key for it in held if it.client.is_operator}
        for it in held:
            counts[it.client.key] += it.weight
        own = counts.pop(client.key, 0)
        candidates = {key: count for key, count in counts.items() if key not in operators}
        if not (client.is_operator and candidates):
            among = counts if client.is_operator else candidates
            candidates = {key: count for key, count in among.items() if count > own + 1}
        if not candidates:
            return False
        most = max(candidates, key=candidates.__getitem__)
        newest = next(it for it in reversed(held) if it.client.key == most)
        del self._held[newest]
        self._ending[newest] = None
        newest.end()
        return True
