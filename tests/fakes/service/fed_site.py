"""A served site that a test feeds with messages."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from fakes.service.scripted_cameras import CAMERAS, LARGE, SMALL, FedService, TrackNumbers, small_config
from fakes.timeouts import PATIENCE
from server.config.loader import load_config
from server.config.running_config import ConfigFileState
from server.config.sections import HttpSettings
from server.http.app import make_app, serving
from server.http.app_keys import SiteControl
from server.service.service import BestViewService

A, B = CAMERAS


class ServedSite:
    """A served site, an HTTP session for it, and its port."""

    def __init__(self, service: FedService, session: aiohttp.ClientSession, port: int) -> None:
        self.service, self.session, self.port = service, session, port

    async def get(self, path: str, method: str = "GET") -> tuple[int, Any]:
        async with self.session.request(method, path) as answer:
            return answer.status, await answer.json() if method != "HEAD" else None

    async def get_json(self, path: str) -> Any:
        code, content = await self.get(path)
        assert code == 200
        return content


def apply_saved_zones(path: Path, served: ServedSite) -> None:
    """Put the zones and rules of a configuration file in force, as a reload does."""
    file, pipeline = load_config(path), served.service
    pipeline.apply_config(pipeline.config.model_copy(update={"zones": file.zones, "rules": file.rules}))


async def serve_site(
    *,
    patience: float = PATIENCE,
    on_disk: Callable[[], ConfigFileState] = lambda: ConfigFileState("", ()),
    control: SiteControl | None = None,
    **changes: Any,
) -> AsyncIterator[ServedSite]:
    service = FedService(small_config(**changes))
    service.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    async with (
        asyncio.timeout(patience),
        serving(
            make_app(BestViewService(service), on_disk, control),
            HttpSettings(port=0, **changes.get("http", {})),
        ) as port,
        aiohttp.ClientSession(f"http://127.0.0.1:{port}") as session,
    ):
        yield ServedSite(service, session, port)
    service.close()


def show_people(served: ServedSite) -> None:
    """Show object 1 to both cameras, larger in c1, and object 2 to c0 alone, until two GOPs are decided."""
    served.service.connect_cameras(*CAMERAS)
    for epoch in range(3):
        served.service.feed(epoch, {A: {1: SMALL, 2: SMALL}, B: {1: LARGE}})


@pytest.fixture
async def served() -> AsyncIterator[ServedSite]:
    async for site in serve_site():
        yield site


@pytest.fixture
async def site_with_people(served: ServedSite) -> ServedSite:
    """Return a site with people in it."""
    show_people(served)
    return served
