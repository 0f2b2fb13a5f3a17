"""Single requests: the site, objects, cameras, the choice of a view, and the past."""

from __future__ import annotations

from collections.abc import AsyncIterator

from client.http import ContractError, HttpSettings, decode_json, get, get_json, read_lines, server_url
from client.model import (
    Camera,
    Cameras,
    Choice,
    Delay,
    Delays,
    Gop,
    Objects,
    Past,
    PersonElsewhere,
    SeenObject,
    Site,
    Span,
)
from client.sse_parser import MAX_EVENT

_DEFAULT = HttpSettings()


async def site(url: str, settings: HttpSettings = _DEFAULT) -> Site:
    """Return the properties that all cameras share.

    Raises:
        ValueError: ``url`` is no address.
        ClientError: the server cannot be reached or is not MyView.
    """
    return await get_json(server_url(url) / "api/site", Site, settings)


async def delays(url: str, settings: HttpSettings = _DEFAULT) -> tuple[Delay, ...]:
    """Return the delays to choose from, each as it is measured now; errors as ``site``."""
    return (await get_json(server_url(url) / "api/delays", Delays, settings)).delays


async def objects(url: str, settings: HttpSettings = _DEFAULT) -> tuple[SeenObject, ...]:
    """Return the objects that are or were tracked, in the server's order; errors as ``site``."""
    return (await get_json(server_url(url) / "api/objects", Objects, settings)).objects


async def elsewhere(url: str, settings: HttpSettings = _DEFAULT) -> tuple[PersonElsewhere, ...]:
    """Return the objects of other services and sites, by number; errors as ``site``."""
    return (await get_json(server_url(url) / "api/objects", Objects, settings)).elsewhere


async def cameras(url: str, settings: HttpSettings = _DEFAULT) -> tuple[Camera, ...]:
    """Return the state of each camera; errors as ``site``."""
    return (await get_json(server_url(url) / "api/cameras", Cameras, settings)).cameras


async def choice(
    url: str, number: int, settings: HttpSettings = _DEFAULT, *, at: str | None = None
) -> Choice:
    """Return which camera shows object ``number`` and what every camera would cost; errors as ``site``.

    ``at`` is a moment of the last minute, as in ``past``, but not before the first request for the object.

    Raises:
        NotFoundError: the object is unknown, or the moment is not recorded.
        RefusedError: ``at`` is not a time.
    """
    address = server_url(url) / f"api/objects/{number}/choice"
    return await get_json(address if at is None else address.with_query({"at": at}), Choice, settings)


async def spans(url: str, number: int, settings: HttpSettings = _DEFAULT) -> tuple[Span, ...]:
    """Return the recorded spans of object ``number``; errors as ``choice``."""
    return (await get_json(server_url(url) / f"api/objects/{number}/past", Past, settings)).spans


async def past(
    url: str, start: str, end: str | None = None, settings: HttpSettings = _DEFAULT
) -> AsyncIterator[Gop]:
    """Yield the events ``gop`` from one moment to another, or up to now; errors as ``site``.

    Moments are seconds back (``-60``), pulses (``p1250``) or times (ISO 8601).

    Raises:
        RefusedError: ``start`` or ``end`` is not a time.
    """
    query = {"from": start} if end is None else {"from": start, "to": end}
    async with get(
        (server_url(url) / "api/past").with_query(query), settings, "application/x-ndjson"
    ) as answer:
        async for line in read_lines(answer, MAX_EVENT):
            try:
                yield decode_json(line, Gop)
            except ValueError as error:
                raise ContractError(f"/api/past is not understood: {error}") from error
