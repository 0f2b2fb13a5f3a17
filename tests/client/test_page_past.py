"""Pause, look back over the last minute, and back to live."""

from __future__ import annotations

from collections.abc import AsyncIterator
from itertools import pairwise

import pytest
import pytest_asyncio
from page_browser import Visit, needs_chromium, visiting
from page_pattern import FPS, GOP
from page_site import STARTS_AT, FakeSite
from playwright.async_api import Browser, expect

from benchmarks.browser import chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="module")]

LIVE = "myview.delays.at(-1).delayMs < 2000"


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def browser() -> AsyncIterator[Browser]:
    async with chromium() as running:
        yield running


async def seconds_of_playing(visit: Visit, seconds: float) -> None:
    seen = await visit.get("myview.pulse")
    await visit.until(f"myview.pulse >= {seen + round(seconds * FPS)}")


async def test_a_press_on_the_strip_shows_that_moment_again(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await seconds_of_playing(visit, 6)
        newest = await visit.get("myview.pulse")
        strip = visit.page.locator("#strip")
        box = await strip.bounding_box()
        assert box is not None
        await strip.click(position={"x": box["width"] * (60 - 4) / 62, "y": 5})
        await visit.until(f"myview.pulse < {newest - 2 * FPS}")
        back = await visit.get("myview.pulse")
        await visit.until(f"myview.pulse > {back + FPS}")
        assert await visit.get("myview.delays.at(-1).delayMs") > 3000
        frames = await visit.get("myview.delays.map((it) => it.pulse)")
        assert sum(after < before for before, after in pairwise(frames)) == 1, "back once, then on"
        await visit.page.get_by_role("button", name="Live", exact=True).click()
        await visit.until(LIVE)
        await expect(visit.page.get_by_role("button", name="Live", exact=True)).to_be_hidden()


async def test_who_pauses_goes_on_where_they_stopped(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.keyboard.press("Space")
        await visit.until("video.paused && myview.state === 'paused'")
        stopped = await visit.get("myview.pulse")
        edge = visit.server.site.edge
        await visit.until("performance.now()")
        await visit.page.wait_for_timeout(4000)
        assert visit.server.site.edge > edge + 3 * FPS
        await visit.page.get_by_role("button", name="Play").click()
        await visit.until(f"!video.paused && myview.pulse > {stopped}")
        assert await visit.get("myview.pulse") < stopped + 2 * FPS
        await visit.page.keyboard.press("End")
        await visit.until(LIVE)


async def test_what_is_not_kept_any_more_is_said_and_live_goes_on(browser: Browser) -> None:
    async with visiting(browser, FakeSite(kept_from=STARTS_AT + 10_000)) as visit:
        await visit.playing(1)
        await seconds_of_playing(visit, 3)
        await visit.page.keyboard.press(",")
        await expect(visit.page.locator("#notice")).to_contain_text("not kept any more")
        seen = await visit.get("myview.pulse")
        await visit.until(f"myview.pulse > {seen + GOP} && {LIVE}")


async def test_another_person_is_watched_at_the_same_moment_of_the_past(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await seconds_of_playing(visit, 6)
        await visit.page.keyboard.press(",")
        await visit.until("myview.delays.at(-1).delayMs > 4000")
        await visit.page.keyboard.press("ArrowRight")
        await visit.playing(2)
        await visit.until("myview.delays.at(-1).delayMs > 4000 && myview.camera === 'c2'")
        await visit.page.keyboard.press("1")
        await visit.until("myview.delays.at(-1).delayMs > 4000 && myview.camera === 'c0'")
