"""How a site is now: what several addresses say, put together."""

from __future__ import annotations

import asyncio

import aiohttp
from yarl import URL

from client.api import choice, objects
from client.http import AwayError, HttpSettings, NotFoundError, RefusedError, get, get_json, server_url
from client.model import SeenObject, Site
from client.status_metrics import Metrics, service_of
from client.status_model import CameraNow, PersonNow, SiteNow

_DEFAULT = HttpSettings()
_ASKED_MOST = 12
"""People of whom it is asked since when their camera shows them."""


async def status(url: str, settings: HttpSettings = _DEFAULT) -> SiteNow:
    """Say how a site is.

    Raises:
        ValueError: ``url`` is no address.
        RefusedError: the server asks for a token, or for another.
        ClientError: it cannot be reached or is no MyView.
    """
    base = server_url(url)
    site = await get_json(base / "api/site", Site, settings)
    (ready, why), metrics, listed, people = await asyncio.gather(
        _ready(base, settings), _metrics(base, settings), _cameras(base, settings), objects(url, settings)
    )
    service = None if metrics is None else service_of(metrics)
    newest = None if metrics is None else metrics.get("myview_pulse")
    return SiteNow(
        name=site.name,
        now=site.now,
        ready=ready,
        why=why,
        pulse=None if newest is None or newest < 0 else int(newest),
        cameras=tuple(_measured(it, metrics) for it in listed),
        people=await _people(url, people, site.fps, settings),
        service=service,
    )


async def _ready(base: URL, settings: HttpSettings) -> tuple[bool, str]:
    """Ask whether a best view can be served: 503 is an answer, too."""
    timeout = aiohttp.ClientTimeout(sock_connect=settings.connect_timeout, sock_read=settings.read_timeout)
    try:
        async with aiohttp.ClientSession(timeout=timeout) as session, session.get(base / "readyz") as answer:
            return answer.ok, " ".join((await answer.text()).split())
    except (aiohttp.ClientError, TimeoutError) as error:
        raise AwayError(f"{base.origin()}: {error or 'no answer'}") from error


async def _metrics(base: URL, settings: HttpSettings) -> Metrics | None:
    try:
        async with get(base / "metrics", settings, "text/plain") as answer:
            return Metrics(await answer.text())
    except RefusedError:
        return None  # a token for one person or camera


async def _cameras(base: URL, settings: HttpSettings) -> list[CameraNow]:
    return list((await get_json(base / "api/cameras", dict[str, list[CameraNow]], settings))["cameras"])


def _measured(camera: CameraNow, metrics: Metrics | None) -> CameraNow:
    if metrics is None:
        return camera
    name = camera.camera
    waiting = metrics.get("myview_camera_waiting_frames", camera=name)
    return CameraNow(
        camera=name,
        state=camera.state,
        message=camera.message,
        fps=camera.fps,
        missed=camera.missed,
        shed=camera.shed,
        late=camera.late,
        in_step=camera.in_step,
        sync_error_s=metrics.get("myview_camera_sync_error_seconds", camera=name, lately="median"),
        tracking_delay_s=metrics.get("myview_camera_tracking_delay_seconds", camera=name, lately="median"),
        certified=metrics.share(
            "myview_camera_certified_windows_total", "myview_camera_windows_total", camera=name
        ),
        waiting=None if waiting is None else int(waiting),
    )


async def _people(
    url: str, people: tuple[SeenObject, ...], fps: float, settings: HttpSettings
) -> tuple[PersonNow, ...]:
    asked = await asyncio.gather(*(_since(url, it, fps, settings) for it in people[:_ASKED_MOST]))
    since = [*asked, *[None] * len(people)]
    return tuple(
        PersonNow(it.object, it.name, it.visible, it.camera, seconds, it.cameras)
        for it, seconds in zip(people, since, strict=False)
    )


async def _since(url: str, person: SeenObject, fps: float, settings: HttpSettings) -> float | None:
    """Give the seconds for which a person's camera shows them already."""
    try:
        told = await choice(url, person.object, settings)
    except NotFoundError:
        return None  # gone meanwhile
    return None if told.since is None else (told.first + told.frames - told.since) / fps
