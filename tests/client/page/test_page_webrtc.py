"""The page plays by WebRTC where its address asks for that, and ends its sessions."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from contextlib import aclosing, suppress
from itertools import count

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Error, Page

from benchmarks.common.browser import chromium
from fakes.page.browser import new_page
from fakes.programs import needs_chromium
from fakes.service.fed_site import A, B, ServedSite, serve_site, show_people
from fakes.service.scripted_cameras import LARGE, SMALL, WIDTH

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="module")]


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def browser() -> AsyncIterator[Browser]:
    async with chromium() as running:
        yield running


async def feed_until_shown(served: ServedSite, page: Page, epochs: Iterator[int]) -> None:
    """Send further GOPs until the page shows one, as cameras do: what is sent before it listens is lost."""
    shown = f"video.videoWidth === {WIDTH}"
    while not await page.evaluate(shown):
        served.service.feed(next(epochs), {A: {1: LARGE}, B: {1: SMALL}})
        with suppress(Error):
            await page.wait_for_function(shown, timeout=500)


async def test_a_person_and_a_held_camera_are_played_by_webrtc(browser: Browser) -> None:
    async with aclosing(serve_site(patience=200)) as sites:
        served = await anext(sites)
        served.service.frames = 1000
        show_people(served)
        epochs = count(3)
        page = await new_page(browser, viewport={"width": 900, "height": 700}, bypass_csp=True)
        address = f"http://127.0.0.1:{served.port}/?object=1&transport=webrtc"
        for path, more in (("objects/1", ""), (f"cameras/{A}", f"&camera={A}")):
            async with page.expect_response(f"**/{path}/whep") as begun:
                await page.goto(address + more)
            assert (await begun.value).status == 201
            await feed_until_shown(served, page, epochs)
        async with page.expect_request(lambda request: request.method == "DELETE") as ended:
            await page.get_by_role("button", name="Automatic").click()
        assert f"/cameras/{A}/whep/" in (await ended.value).url
        await page.close()
