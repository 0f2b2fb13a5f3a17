"""Where there are no Media Source Extensions, as on older iPhones: HLS, which the browser plays by itself."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator

import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import Visit, camera_on_the_stage, visiting
from fakes.page.site import SEGMENT, FakeSite
from fakes.page.video_pattern import FPS
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]

AS_A_PHONE = "delete window.MediaSource; delete window.ManagedMediaSource; window.begun = () => NaN;"
TELLS = "HTMLMediaElement.prototype.getStartDate = function () { return new Date(window.begun(this.src)) };"
"""Of what Safari adds to a video element; the rest of HLS Chromium plays by itself."""


@contextlib.asynccontextmanager
async def visiting_by_phone(browser: Browser, script: str) -> AsyncIterator[Visit]:
    async with visiting(browser, FakeSite(recorded=600), script=script) as visit:
        if not await visit.get("video.canPlayType('application/vnd.apple.mpegurl')"):
            pytest.skip("this Chromium does not play HLS by itself")
        yield visit


async def test_the_best_view_is_played_and_what_cannot_be_known_is_said(browser: Browser) -> None:
    async with visiting_by_phone(browser, AS_A_PHONE) as visit:
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


async def test_where_the_browser_tells_the_time_frames_have_their_pulses(browser: Browser) -> None:
    async with visiting_by_phone(browser, AS_A_PHONE + TELLS) as visit:
        await visit.until("myview.state === 'playing'")
        # Chromium counts from the beginning of the first segment that it fetched.
        first, pulse0 = visit.server.site.fetched[0], visit.server.site.pulse0
        await visit.get(f"""void (window.begun = (source) => {{
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
        assert await camera_on_the_stage(visit) == "c2"
        await visit.page.keyboard.press("0")
        await visit.playing(1)
        await visit.page.keyboard.press(",")
        await visit.until("video.currentSrc.includes('/objects/1/hls/index.m3u8?from=p')")
        await visit.until("video.currentTime > 0.3 && myview.state === 'playing'")
        back = int((await visit.get("video.currentSrc")).split("?from=p")[1])
        assert back - SEGMENT <= await visit.get("myview.pulse") < back + 3 * FPS
        await visit.page.get_by_role("button", name="Live", exact=True).click()
        await visit.until("!video.currentSrc.includes('from') && myview.state === 'playing'")


async def test_a_browser_that_plays_neither_is_told_so(browser: Browser) -> None:
    nothing = AS_A_PHONE + "HTMLMediaElement.prototype.canPlayType = () => '';"
    async with visiting(browser, script=nothing) as visit:
        await visit.until("myview.state === 'unsupported'")
        await expect(visit.page.get_by_role("status")).to_contain_text("No live video here")
