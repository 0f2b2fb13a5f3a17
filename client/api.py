"""What is known on the server, asked once: site, objects, cameras, why this view."""

from __future__ import annotations

from client.http import HttpSettings, get_json, server_url
from client.model import Camera, Cameras, Choice, Objects, SeenObject, Site

_DEFAULT = HttpSettings()


async def site(url: str, settings: HttpSettings = _DEFAULT) -> Site:
    """Give what holds for all cameras.

    Raises:
        ValueError: ``url`` is no address.
        ClientError: the server cannot be reached or is no MyView.
    """
    return await get_json(server_url(url) / "api/site", Site, settings)


async def objects(url: str, settings: HttpSettings = _DEFAULT) -> tuple[SeenObject, ...]:
    """Give everything that is or was tracked, as the server lists it; errors as ``site``."""
    return (await get_json(server_url(url) / "api/objects", Objects, settings)).objects


async def cameras(url: str, settings: HttpSettings = _DEFAULT) -> tuple[Camera, ...]:
    """Give how each camera does; errors as ``site``."""
    return (await get_json(server_url(url) / "api/cameras", Cameras, settings)).cameras


async def choice(url: str, number: int, settings: HttpSettings = _DEFAULT) -> Choice:
    """Give which camera shows object ``number`` and what every camera would cost; errors as ``site``.

    Raises:
        NotFoundError: there is no such object.
    """
    return await get_json(server_url(url) / f"api/objects/{number}/choice", Choice, settings)
