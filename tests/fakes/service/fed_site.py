"""A served site that a test feeds with messages."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import aiohttp
import pytest

from fakes.service.scripted_cameras import CAMERAS, LARGE, SMALL, FedService, TrackNumbers, small_config
from fakes.timeouts import PATIENCE
from server.config.sections import HttpSettings
from server.http.app import make_app, serving
from server.service.service import BestViewService

A, B = CAMERAS


class Hall:
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


async def opened(*, patience: float = PATIENCE, **changes: Any) -> AsyncIterator[Hall]:
    service = FedService(small_config(**changes))
    service.decider.people._registry = TrackNumbers()  # type: ignore[assignment]
    async with (
        asyncio.timeout(patience),
        serving(make_app(BestViewService(service)), HttpSettings(port=0, **changes.get("http", {}))) as port,
        aiohttp.ClientSession(f"http://127.0.0.1:{port}") as session,
    ):
        yield Hall(service, session, port)
    service.close()


def see(hall: Hall) -> None:
    """Show object 1 to both cameras, larger in c1, and object 2 to c0 alone, until two GOPs are decided."""
    hall.service.come(*CAMERAS)
    for epoch in range(3):
        hall.service.feed(epoch, {A: {1: SMALL, 2: SMALL}, B: {1: LARGE}})


@pytest.fixture
async def hall() -> AsyncIterator[Hall]:
    async for site in opened():
        yield site


@pytest.fixture
async def busy(hall: Hall) -> Hall:
    """Return a hall with people in it."""
    see(hall)
    return hall
