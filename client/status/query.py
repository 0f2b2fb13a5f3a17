"""The status of a site, from several requests."""

from __future__ import annotations

import asyncio

from yarl import URL

from client.api import choice, objects
from client.http import (
    HttpSettings,
    NotFoundError,
    RefusedError,
    get_any,
    get_body,
    get_json,
    read_body,
    server_url,
)
from client.model import SeenObject, Site
from client.status.model import CameraNow, PersonNow, SiteNow
from client.status.prometheus_text import Metrics, service_of

_DEFAULT = HttpSettings()
_MAX_CHOICES = 12
"""People for whom the choice of their view is requested."""
_MAX_READYZ = 64_000
"""Bytes of the response of ``/readyz``."""


async def status(url: str, settings: HttpSettings = _DEFAULT) -> SiteNow:
    """Return the status of a site.

    Raises:
        ValueError: ``url`` is no address.
        RefusedError: the token is missing or wrong.
        ClientError: the server cannot be reached or is not MyView.
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
        cameras=tuple(_measured(camera, metrics) for camera in listed),
        people=await _people(url, people, site.fps, settings),
        service=service,
    )


async def _ready(base: URL, settings: HttpSettings) -> tuple[bool, str]:
    """Return whether a best view can be served, and why not; a 503 is a valid response."""
    async with get_any(base / "readyz", settings, "text/plain") as answer:
        return answer.ok, " ".join(_text(await read_body(answer, settings, _MAX_READYZ)).split())


async def _metrics(base: URL, settings: HttpSettings) -> Metrics | None:
    try:
        return Metrics(_text(await get_body(base / "metrics", settings, "text/plain")))
    except RefusedError:
        return None  # a token for one person or camera


def _text(body: bytes) -> str:
    return body.decode(errors="replace")


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
        synchronized=camera.synchronized,
        sync_error_s=metrics.get("myview_camera_sync_error_seconds", camera=name, statistic="median"),
        tracking_delay_s=metrics.get("myview_camera_tracking_delay_seconds", camera=name, statistic="median"),
        optimal=metrics.share(
            "myview_camera_optimal_windows_total", "myview_camera_windows_total", camera=name
        ),
        waiting=None if waiting is None else int(waiting),
        retry_at=camera.retry_at,
    )


async def _people(
    url: str, people: tuple[SeenObject, ...], fps: float, settings: HttpSettings
) -> tuple[PersonNow, ...]:
    known = await asyncio.gather(*(_since(url, person, fps, settings) for person in people[:_MAX_CHOICES]))
    since = [*known, *[None] * len(people)]
    return tuple(
        PersonNow(person.object, person.name, person.visible, person.camera, seconds, person.cameras)
        for person, seconds in zip(people, since, strict=False)
    )


async def _since(url: str, person: SeenObject, fps: float, settings: HttpSettings) -> float | None:
    """Return for how many seconds the current camera has shown a person."""
    try:
        decision = await choice(url, person.object, settings)
    except NotFoundError:
        return None  # gone meanwhile
    if decision.since is None:
        return None
    return (decision.first + decision.frames - decision.since) / fps
