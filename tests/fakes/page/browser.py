"""Headless Chromium with the page of a fake site."""

from __future__ import annotations

import contextlib
import io
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Any

import av
import numpy as np
import numpy.typing as npt
import pytest_asyncio
from playwright.async_api import Browser, Page, expect

from benchmarks.common.browser import chromium
from fakes.page.site import FakeSite, SiteServer, serving
from fakes.page.video_pattern import CAMERAS, FPS, GROUNDS
from fakes.timeouts import PATIENCE_MS

expect.set_options(timeout=PATIENCE_MS)


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def browser() -> AsyncIterator[Browser]:
    """Start one browser for the tests of a module, which run in one loop; each has pages of its own."""
    async with chromium() as running:
        yield running


@dataclass(frozen=True, slots=True)
class Visit:
    """An open page, and its site."""

    page: Page
    server: SiteServer

    async def until(self, condition: str) -> None:
        """Wait until a JavaScript expression holds; the page may load once more meanwhile."""
        loaded = "typeof myview !== 'undefined'"
        await self.page.wait_for_function(f"{loaded} && ({condition})", timeout=PATIENCE_MS)

    async def playing(self, person: int) -> None:
        """Wait until frames of a person are shown."""
        await self.until(
            f"myview.state === 'playing' && myview.object === {person} && myview.camera !== null"
            " && myview.switches.at(-1)?.shownAt !== null"
        )

    async def get(self, expression: str) -> Any:
        """Return the value of a JavaScript expression."""
        return await self.page.evaluate(expression)

    async def screenshot(self) -> npt.NDArray[np.int16]:
        """Return a screenshot of the stage, RGB `(height, width, 3)`."""
        image = await self.page.locator("#stage").screenshot()
        with av.open(io.BytesIO(image), "r") as container:
            return next(container.decode(video=0)).to_ndarray(format="rgb24").astype(np.int16)


async def new_page(browser: Browser, **options: Any) -> Page:
    """Open an empty page that waits for as long as a busy machine takes."""
    page = await browser.new_page(**options)
    page.set_default_timeout(PATIENCE_MS)
    return page


@contextlib.asynccontextmanager
async def visiting(
    browser: Browser,
    site: FakeSite | None = None,
    query: str = "",
    width: int = 800,
    height: int = 900,
    script: str = "",
    slowness: int = 1,
) -> AsyncIterator[Visit]:
    """Open the page of a site, after an optional script; an exception in the page fails the test.

    `slowness`: by how much processing takes longer.
    """
    failures: list[str] = []
    async with serving(site or FakeSite()) as server:
        # The site's policy forbids eval, which evaluates the conditions of these tests.
        page = await new_page(browser, viewport={"width": width, "height": height}, bypass_csp=True)
        page.on("pageerror", lambda error: failures.append(str(error)))
        if slowness > 1:
            session = await page.context.new_cdp_session(page)
            await session.send("Emulation.setCPUThrottlingRate", {"rate": slowness})
        if script:
            await page.add_init_script(script)
        try:
            await page.goto(server.url + query)
            yield Visit(page, server)
        finally:
            await page.close()
    assert not failures


async def play_for(visit: Visit, seconds: float) -> None:
    pulse = await visit.get("myview.pulse")
    await visit.until(f"myview.pulse >= {pulse + round(seconds * FPS)}")


async def displayed_camera(visit: Visit) -> str:
    """Return the shown camera, by the tint of the picture."""
    ground = np.median((await visit.screenshot()).reshape(-1, 3), axis=0)
    return CAMERAS[int(np.abs(np.array(GROUNDS) - ground).sum(axis=1).argmin())]
