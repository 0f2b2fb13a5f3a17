"""Distributes people over the best-view services of one site."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from server.config.sections import ShareSettings


def shard_of(number: int, share: ShareSettings) -> int:
    """Return the share that a number belongs to: the same in all services, without communication."""
    return number % share.of


def own_numbers(numbers: Iterable[int], merged: Mapping[int, int], share: ShareSettings) -> list[int]:
    """Return the numbers that belong to this service's share, in the given order.

    Besides the share's own numbers these are people into whom one of them was merged, so that viewers of the
    old number need not change the service.
    """
    if share.of == 1:
        return list(numbers)
    kept_numbers = {new for old, new in merged.items() if shard_of(old, share) == share.share}
    return [number for number in numbers if shard_of(number, share) == share.share or number in kept_numbers]


def replacement_addresses(share: ShareSettings) -> list[str]:
    """Return the addresses of the other services of this one's share."""
    return [
        server.rstrip("/") + "/"
        for index, server in enumerate(share.servers)
        if index != share.index and index % share.of == share.share
    ]


def shard_address(number: int, share: ShareSettings) -> str | None:
    """Return the address of the first service of a number's share; None where the configuration has none."""
    return share.servers[shard_of(number, share)].rstrip("/") + "/" if share.servers else None
