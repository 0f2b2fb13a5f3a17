"""Recovery of the page from lost connections, restarts, gaps and broken streams."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import visiting
from fakes.page.site import FIRST_PULSE, FakeSite
from fakes.page.video_pattern import FPS
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]


async def test_a_lost_connection_is_reported_under_the_last_frame_and_restored(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.get("window.visit = 'the same'")
        site = visit.server.site
        await visit.server.stop()
        await visit.until("myview.state === 'lost'")
        await expect(visit.page.get_by_role("status")).to_contain_text("Connection lost, reconnecting")
        await expect(visit.page.locator("#stage")).to_have_class("stage pictured")
        await visit.server.restart_as(site)
        last = await visit.get("myview.pulse")
        await visit.playing(1)
        await visit.until(f"myview.pulse > {last + FPS}")
        assert await visit.get("window.visit") == "the same"


@pytest.mark.parametrize("first", [500, FIRST_PULSE + 900_000], ids=["earlier", "later"])
async def test_a_site_whose_pulses_restart_plays_on(browser: Browser, first: int) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.server.restart_as(FakeSite(first_pulse=first))
        await visit.until(f"Math.abs(myview.pulse - {first}) < 2000 && myview.state === 'playing'")
        shown = await visit.get("myview.pulse")
        await visit.until(f"myview.pulse > {shown + FPS} && myview.camera !== null")
        delay = await visit.get("myview.delays.at(-1).delayMs")
        assert 0 < delay < 30_000


async def test_before_the_first_keyframe_the_page_waits(
    browser: Browser,
) -> None:
    site = FakeSite(codec=None)
    async with visiting(browser, site) as visit:
        await visit.until("myview.state === 'waiting'")
        assert site.opened == []
        await visit.server.restart_as(FakeSite())
        await visit.playing(1)


async def test_a_page_opened_before_the_first_keyframe_plays_when_it_arrives(browser: Browser) -> None:
    site = FakeSite(codec=None)
    async with visiting(browser, site) as visit:
        await visit.until("myview.state === 'waiting' && performance.now() > 2500")
        site.codec = "avc1.42C01F"
        await visit.playing(1)


async def test_a_gap_in_the_stream_is_skipped(browser: Browser) -> None:
    site = FakeSite()
    site.skipped = range(site.edge + 2 * FPS, site.edge + 2 * FPS + 8)
    async with visiting(browser, site) as visit:
        await visit.until(f"myview.pulse > {site.skipped.stop + FPS}")
        pulses = await visit.get("myview.delays.map((delay) => delay.pulse)")
        assert not set(pulses) & set(site.skipped)


async def test_a_broken_stream_is_requested_again(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.server.break_streams()
        shown = await visit.get("myview.pulse")
        await visit.until(f"myview.pulse > {shown + 2 * FPS}")
        assert visit.server.site.opened == [1, 1]
        await visit.until("myview.state === 'playing'")


async def test_an_undecodable_stream_is_requested_again_with_backoff(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        fails = "video.dispatchEvent(new Event('error'))"
        await visit.get(
            f"""(() => {{
                window.failing = setInterval(() => {fails}, 20);
                setTimeout(() => clearInterval(window.failing), 2000);
            }})()"""
        )
        await visit.playing(1)
        shown = await visit.get("myview.pulse")
        await visit.until(f"myview.pulse > {shown + 3 * FPS}")
        assert len(visit.server.site.opened) < 10
