"""Who makes room where more have come than there are places."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Protocol, TypeVar


class Placed(Protocol):
    """A connection that takes a place."""

    @property
    def origin(self) -> str:
        """Whose it is: the user that it has proven to be, or else the address that it comes from."""


Connection = TypeVar("Connection", bound=Placed)


def who_makes_room(there: Sequence[Connection]) -> Connection:
    """Return the oldest connection of the origin that has the most, of some in the order of coming.

    So whoever opens very many pushes out their own. Ties go to the oldest.
    """
    counts = Counter(it.origin for it in there)
    most = max(counts.values())
    return next(it for it in there if counts[it.origin] == most)
