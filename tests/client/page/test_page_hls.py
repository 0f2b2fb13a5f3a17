"""Native HLS, where there are no Media Source Extensions, as on older iPhones."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator

import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import Visit, displayed_camera, visiting
from fakes.page.site import SEGMENT, FakeSite
from fakes.page.video_pattern import FPS
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]

WITHOUT_MSE = "delete window.MediaSource; delete window.ManagedMediaSource; window.startTime = () => NaN;"
WITH_START_DATE = (
    "HTMLMediaElement.prototype.getStartDate = function () { return new Date(window.startTime(this.src)) };"
)
"""Safari's extension of a video element; Chromium plays HLS natively otherwise."""


@contextlib.asynccontextmanager
async def visiting_with_hls(browser: Browser, script: str) -> AsyncIterator[Visit]:
    async with visiting(browser, FakeSite(recorded=600), script=script) as visit:
        if not await visit.get("video.canPlayType('application/vnd.apple.mpegurl')"):
            pytest.skip("this Chromium does not play HLS natively")
        yield visit


async def test_without_frame_times_the_best_view_plays_without_boxes(browser: Browser) -> None:
    async with visiting_with_hls(browser, WITHOUT_MSE) as visit:
        await visit.until("myview.state === 'playing'")
        assert set(visit.server.site.listed) == {"/objects/1/hls/index.m3u8"}
        assert visit.server.site.opened == []
        await expect(visit.page.locator("#reason")).to_contain_text("no boxes")
        await expect(visit.page.locator("#camera")).to_be_empty()
        await visit.page.get_by_role("button", name="Pause").click()
        await visit.until("myview.state === 'paused'")
        await visit.page.keyboard.press("Space")
        await visit.until("myview.state === 'playing'")
        await visit.page.keyboard.press("2")
        await visit.until("myview.state === 'playing' && video.currentSrc.includes('/cameras/c1/hls/')")
        await visit.page.keyboard.press("ArrowRight")
        await visit.until("myview.state === 'playing' && video.currentSrc.includes('/objects/2/hls/')")


async def test_with_a_start_date_frames_are_mapped_to_pulses(browser: Browser) -> None:
    async with visiting_with_hls(browser, WITHOUT_MSE + WITH_START_DATE) as visit:
        await visit.until("myview.state === 'playing'")
        # Chromium's media time 0 is the start of the first segment that it fetched.
        first, pulse0 = visit.server.site.fetched[0], visit.server.site.pulse0
        await visit.get(f"""void (window.startTime = (source) => {{
            const from = Number(new URL(source).searchParams.get('from')?.slice(1) ?? {first});
            return ({pulse0} + (from - from % {SEGMENT}) / {FPS}) * 1000;
        }})""")
        await visit.playing(1)
        for _ in range(4):
            await visit.page.wait_for_timeout(500)
            shown = await visit.get("[myview.pulse, myview.camera]")
            assert shown[1] == "c" + str(visit.server.site.camera(1, shown[0]))
        await visit.page.keyboard.press("3")
        await visit.until("myview.camera === 'c2'")
        assert await displayed_camera(visit) == "c2"
        await visit.page.keyboard.press("0")
        await visit.playing(1)
        await visit.page.keyboard.press(",")
        await visit.until("video.currentSrc.includes('/objects/1/hls/index.m3u8?from=p')")
        await visit.until("video.currentTime > 0.3 && myview.state === 'playing'")
        back = int((await visit.get("video.currentSrc")).split("?from=p")[1])
        assert back - SEGMENT <= await visit.get("myview.pulse") < back + 3 * FPS
        await visit.page.get_by_role("button", name="Live", exact=True).click()
        await visit.until("!video.currentSrc.includes('from') && myview.state === 'playing'")


async def test_a_browser_with_neither_shows_that_it_is_unsupported(browser: Browser) -> None:
    neither = WITHOUT_MSE + "HTMLMediaElement.prototype.canPlayType = () => '';"
    async with visiting(browser, script=neither) as visit:
        await visit.until("myview.state === 'unsupported'")
        await expect(visit.page.get_by_role("status")).to_contain_text("No live video here")
