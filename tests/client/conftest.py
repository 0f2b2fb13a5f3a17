"""Fixtures of the client's tests."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager

import pytest
import pytest_asyncio
from aiohttp import web
from aiohttp.test_utils import TestServer
from playwright.async_api import Browser

from benchmarks.common.browser import chromium
from fakes.http.scripted_server import ScriptedSite, Serve
from server.cli.generated_config import free_port


@pytest_asyncio.fixture(scope="session", loop_scope="session")
async def browser() -> AsyncIterator[Browser]:
    """Start one browser for all tests; each test has isolated pages."""
    async with chromium() as running:
        yield running


@pytest.fixture
def scripted_site() -> ScriptedSite:
    return ScriptedSite()


@pytest.fixture
async def site_url(scripted_site: ScriptedSite) -> AsyncIterator[str]:
    """Serve the scripted site over real HTTP; return its address."""
    async with _served(scripted_site) as url:
        yield url


@asynccontextmanager
async def _served(site: ScriptedSite) -> AsyncIterator[str]:
    server = TestServer(site.app())
    await server.start_server(shutdown_timeout=0.1)
    try:
        yield str(server.make_url("/"))
    finally:
        await server.close()


@pytest.fixture
async def serve() -> AsyncIterator[Serve]:
    """Return a function that serves a scripted site and returns its address."""
    async with AsyncExitStack() as stack:

        async def start(site: ScriptedSite) -> str:
            runner = web.AppRunner(site.app(), shutdown_timeout=0.1)
            await runner.setup()
            stack.push_async_callback(runner.cleanup)
            port = free_port()
            await web.TCPSite(runner, "127.0.0.1", port).start()
            return f"http://127.0.0.1:{port}/"

        yield start
