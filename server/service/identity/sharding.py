"""Which best-view service decides for whom, where several share one site."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from server.config.sections import ShareSettings


def index_of(number: int, share: ShareSettings) -> int:
    """Return which service answers for a number: the same in all of them, and nobody has to ask."""
    return number % share.of


def served(numbers: Iterable[int], merged: Mapping[int, int], share: ShareSettings) -> list[int]:
    """Return those of people's numbers whom this service decides for, in the given order.

    It does for its own numbers, and for whoever turned out to be one of its own: who watches an old number
    stays there.
    """
    if share.of == 1:
        return list(numbers)
    known_as = {new for old, new in merged.items() if index_of(old, share) == share.index}
    return [number for number in numbers if index_of(number, share) == share.index or number in known_as]


def server_of(number: int, share: ShareSettings) -> str | None:
    """Return the address of the service that answers for a number; None: the configuration does not say."""
    return share.servers[index_of(number, share)].rstrip("/") + "/" if share.servers else None
