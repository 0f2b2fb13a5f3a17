"""Time shift: pausing, playing the past, and returning to live."""

from __future__ import annotations

import asyncio
from itertools import count, pairwise

import numpy as np
import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import Visit, play_for, visiting
from fakes.page.site import FIRST_PULSE, FakeSite
from fakes.page.video_pattern import CAMERAS, FPS, GOP
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]

HIDDEN = "Object.defineProperty(document, 'hidden', {{ value: {}, configurable: true }})"
LIVE = "myview.delays.at(-1).delayMs < 2000"


async def first_after(visit: Visit, paused_at: int) -> int:
    """Return the first pulse displayed after the one at which the video was paused."""
    await visit.until(f"!video.paused && myview.pulse > {paused_at}")
    return int(await visit.get(f"myview.delays.find((delay) => delay.pulse > {paused_at}).pulse"))


async def test_a_press_on_the_timeline_plays_from_that_moment(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await play_for(visit, 6)
        newest = await visit.get("myview.pulse")
        strip = visit.page.locator("#strip")
        box = await strip.bounding_box()
        assert box is not None
        await strip.click(position={"x": box["width"] * (60 - 4) / 62, "y": 5})
        await visit.until(f"myview.pulse < {newest - 2 * FPS}")
        back = await visit.get("myview.pulse")
        await visit.until(f"myview.pulse > {back + FPS}")
        assert await visit.get("myview.delays.at(-1).delayMs") > 3000
        frames = await visit.get("myview.delays.map((delay) => delay.pulse)")
        assert sum(after < before for before, after in pairwise(frames)) == 1, "one jump back, then forward"
        await visit.page.get_by_role("button", name="Live", exact=True).click()
        await visit.until(LIVE)
        await expect(visit.page.get_by_role("button", name="Live", exact=True)).to_be_hidden()


async def test_playback_resumes_where_it_was_paused(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.keyboard.press("Space")
        await visit.until("video.paused && myview.state === 'paused'")
        paused_at = await visit.get("myview.pulse")
        visit.server.site.pulse0 -= 20
        await visit.until("video.buffered.end(video.buffered.length - 1) > video.currentTime + 20")
        await visit.page.get_by_role("button", name="Play").click()
        assert await first_after(visit, paused_at) < paused_at + 2 * FPS
        await visit.page.keyboard.press("End")
        await visit.until(f"myview.pulse > {paused_at + 20 * FPS}")
        steps = np.diff(await visit.get("myview.delays.map((delay) => delay.pulse)"))
        assert steps.max() > 10 * FPS, "a jump to live"


async def play_five_seconds_back(visit: Visit) -> int:
    """Go back five seconds; return the displayed pulse."""
    await visit.playing(1)
    await play_for(visit, 6)
    await visit.page.keyboard.press(",")
    await visit.until("myview.delays.at(-1).delayMs > 4000")
    return int(await visit.get("myview.pulse"))


async def pause_until_suspended(visit: Visit) -> int:
    """Buffer so much behind a paused video that the page cancels its stream; return the displayed pulse."""
    await visit.until("video.paused")
    paused_at = int(await visit.get("myview.pulse"))
    visit.server.site.ahead = 40
    await visit.until("video.buffered.end(video.buffered.length - 1) > video.currentTime + 30")
    await visit.page.wait_for_timeout(300)
    visit.server.site.people[3] = False  # makes the page update
    await expect(visit.page.locator(".cards li")).to_have_count(3)
    await visit.page.wait_for_timeout(300)
    # A few frames may still be reported after the pause.
    assert await visit.get("video.paused && myview.pulse") - paused_at in range(6)
    assert visit.server.site.opened == [1], "the stream is not requested again"
    return paused_at


async def test_a_long_pause_lasts_until_it_is_ended(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.keyboard.press("Space")
        paused_at = await pause_until_suspended(visit)
        await visit.page.keyboard.press("Space")
        assert await first_after(visit, paused_at) < paused_at + 2 * FPS


@pytest.mark.parametrize(
    "wake_up",
    ["video.play()", f"{HIDDEN.format('false')} && document.dispatchEvent(new Event('visibilitychange'))"],
)
async def test_a_video_paused_by_the_browser_on_a_hidden_page_resumes_live(
    browser: Browser, wake_up: str
) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        requests: list[str] = []
        visit.page.on("request", lambda request: requests.append(request.url))
        await visit.get(f"{HIDDEN.format('true')} && video.pause()")
        paused_at = await pause_until_suspended(visit)
        await visit.get(wake_up)
        await visit.until(f"myview.pulse > {paused_at + 30 * FPS}")
        assert not any("from=" in address for address in requests)


async def test_a_slowly_arriving_past_is_displayed(browser: Browser) -> None:
    rest_arrives = asyncio.Event()
    async with visiting(browser, FakeSite(recorded=1800, past_released=rest_arrives)) as visit:
        await visit.playing(1)
        await visit.page.keyboard.press("Space")
        await visit.until("video.paused && myview.state === 'paused'")
        await visit.page.get_by_label("Range of the timeline").select_option("Last 10 minutes")
        paused_at = await visit.get("myview.pulse")
        strip = visit.page.locator("#strip")
        box = await strip.bounding_box()
        assert box is not None
        # In the middle of a GOP, so that its first frame is not the requested one.
        x = next(x for x in count(100) if 4 <= (paused_at + (x / box["width"] * 620 - 600) * FPS) % GOP <= 6)
        await strip.click(position={"x": x, "y": 5})
        await visit.until("video.buffered.length && video.buffered.start(0) < video.currentTime - 100")
        rest_arrives.set()
        await visit.until(f"myview.pulse < {paused_at - 100 * FPS}")


async def test_the_timeline_covers_the_whole_recording(browser: Browser) -> None:
    async with visiting(browser, FakeSite(recorded=1800)) as visit:
        await visit.playing(1)
        span = visit.page.get_by_label("Range of the timeline")
        await expect(span.locator("option")).to_have_text(["Last minute", "Last 10 minutes", "Last hour"])
        await span.select_option("Last 10 minutes")
        strip = visit.page.locator("#strip")
        box = await strip.bounding_box()
        assert box is not None
        newest = await visit.get("myview.pulse")
        await strip.click(position={"x": box["width"] * (600 - 300) / 620, "y": 5})
        await visit.until(
            f"Math.abs(myview.pulse - {newest - 300 * FPS}) < {30 * FPS} && myview.camera !== null"
        )
        await visit.until(
            f"new Set(myview.cuts.slice(-2).map((cut) => cut.to)).size > 1 && myview.pulse < {newest}"
        )
        site = visit.server.site
        for cut in await visit.get("myview.cuts.slice(-2)"):
            assert cut["to"] == CAMERAS[site.camera(1, cut["pulse"])]
        await span.select_option("Last minute")
        await visit.page.get_by_role("button", name="Live", exact=True).click()
        await visit.until(LIVE)


async def test_a_pause_during_a_restart_of_the_pulses_resumes_live(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.keyboard.press("Space")
        await visit.until("video.paused")
        paused_at = await visit.get("myview.pulse")
        await visit.server.restart_as(FakeSite(first_pulse=500))
        restarted = "Math.abs(myview.site.pulse0 - Date.now() / 1000) < 40"
        await visit.until(f"myview.state === 'paused' && {restarted}")
        await visit.page.wait_for_timeout(1000)
        assert await visit.get("video.paused && myview.pulse") - paused_at in range(6), "the frame stays"
        await visit.page.keyboard.press("Space")
        await visit.until(f"!video.paused && myview.pulse < 2000 && {LIVE}")
        await expect(visit.page.locator("#notice")).to_be_empty()


async def test_playback_resumed_outside_the_page_continues_where_it_was_paused(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.get("video.pause()")
        paused_at = await visit.get("myview.pulse")
        visit.server.site.ahead = 20
        await visit.until("video.buffered.end(video.buffered.length - 1) > video.currentTime + 15")
        await visit.get("video.play()")
        await visit.until(f"!video.paused && myview.pulse > {paused_at + FPS}")
        assert await visit.get("myview.pulse") < paused_at + 5 * FPS
        await expect(visit.page.get_by_role("button", name="Live", exact=True)).to_be_visible()


@pytest.mark.slow
async def test_the_past_continues_where_its_stream_broke(browser: Browser) -> None:
    async with visiting(browser) as visit:
        back = await play_five_seconds_back(visit)
        await visit.server.break_streams()
        await visit.until(f"myview.pulse > {back + 6 * FPS}")
        assert await visit.get("myview.delays.at(-1).delayMs") > 4000
        await expect(visit.page.locator("#notice")).to_be_empty()


async def test_a_pause_of_a_person_who_has_left_resumes_live_without_a_notice(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.keyboard.press("Space")
        visit.server.site.people = {1: False, 2: True}
        visit.server.site.replayable_from = FIRST_PULSE + 100_000
        await pause_until_suspended(visit)
        await visit.page.keyboard.press("Space")
        await visit.until(f"!video.paused && {LIVE}")
        await expect(visit.page.locator("#notice")).to_be_empty()


async def test_an_unrecorded_moment_is_reported_and_playback_is_live(browser: Browser) -> None:
    async with visiting(browser, FakeSite(replayable_from=FIRST_PULSE + 10_000)) as visit:
        await visit.playing(1)
        await play_for(visit, 3)
        await visit.page.keyboard.press(",")
        await expect(visit.page.locator("#notice")).to_contain_text("There is no recording of that time")
        pulse = await visit.get("myview.pulse")
        await visit.until(f"myview.pulse > {pulse + GOP} && {LIVE}")


@pytest.mark.slow
async def test_another_person_is_played_from_the_same_moment_of_the_past(browser: Browser) -> None:
    async with visiting(browser) as visit:
        back = await play_five_seconds_back(visit)
        async with visit.page.expect_request(lambda request: "choice?at=p" in request.url):
            await visit.until(f"myview.pulse > {back + 2 * FPS}")
        await visit.page.keyboard.press("ArrowRight")
        await visit.playing(2)
        assert await visit.get("myview.pulse") > back + FPS, "continues from the displayed moment"
        await visit.until("myview.delays.at(-1).delayMs > 4000 && myview.camera === 'c2'")
        await visit.page.keyboard.press("1")
        await visit.until("myview.delays.at(-1).delayMs > 4000 && myview.camera === 'c0'")
