"""The demo at a chosen frame rate, for busy machines."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

from playwright.async_api import Error, Page

from server.cli.demo import run_demo
from server.cli.generated_config import free_port

_RETRY_MS = 1000


@contextlib.asynccontextmanager
async def demo_at(fps: float) -> AsyncIterator[str]:
    """Run the demo at a frame rate; yield its address, which may not answer yet."""
    port = free_port()
    running = asyncio.create_task(run_demo(port, None, open_browser=False, fps=fps))
    try:
        yield f"http://127.0.0.1:{port}/"
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


async def open_when_ready(page: Page, url: str) -> None:
    """Open a page, retrying until its server answers."""
    while True:
        with contextlib.suppress(Error):
            await page.goto(url)
            return
        await page.wait_for_timeout(_RETRY_MS)
