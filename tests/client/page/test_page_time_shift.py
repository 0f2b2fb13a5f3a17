"""Pause, look back over the last minute, and back to live."""

from __future__ import annotations

import asyncio
from itertools import count, pairwise

import numpy as np
import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import Visit, seconds_of_playing, visiting
from fakes.page.site import STARTS_AT, FakeSite
from fakes.page.video_pattern import CAMERAS, FPS, GOP
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]

HIDDEN = "Object.defineProperty(document, 'hidden', {{ value: {}, configurable: true }})"
LIVE = "myview.delays.at(-1).delayMs < 2000"


async def first_after(visit: Visit, stopped: int) -> int:
    """Return the first pulse that is shown after one at which the picture stood."""
    await visit.until(f"!video.paused && myview.pulse > {stopped}")
    return int(await visit.get(f"myview.delays.find((it) => it.pulse > {stopped}).pulse"))


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
        visit.server.site.pulse0 -= 20
        await visit.until("video.buffered.end(video.buffered.length - 1) > video.currentTime + 20")
        await visit.page.get_by_role("button", name="Play").click()
        assert await first_after(visit, stopped) < stopped + 2 * FPS
        await visit.page.keyboard.press("End")
        await visit.until(f"myview.pulse > {stopped + 20 * FPS}")
        steps = np.diff(await visit.get("myview.delays.map((it) => it.pulse)"))
        assert steps.max() > 10 * FPS, "at once"


async def some_seconds_back(visit: Visit) -> int:
    """Look at what was shown five seconds ago; give the pulse that is shown then."""
    await visit.playing(1)
    await seconds_of_playing(visit, 6)
    await visit.page.keyboard.press(",")
    await visit.until("myview.delays.at(-1).delayMs > 4000")
    return int(await visit.get("myview.pulse"))


async def left_for_long(visit: Visit) -> int:
    """Let the stream of a paused picture run on until the page leaves it; give the pulse that is shown."""
    await visit.until("video.paused")
    stopped = int(await visit.get("myview.pulse"))
    visit.server.site.ahead = 40
    await visit.until("video.buffered.end(video.buffered.length - 1) > video.currentTime + 30")
    await visit.page.wait_for_timeout(300)
    visit.server.site.people[3] = False  # of whom the page is told
    await expect(visit.page.locator(".cards li")).to_have_count(3)
    await visit.page.wait_for_timeout(300)
    # A few frames may be told of that were on their way to the screen when the picture was stopped.
    assert await visit.get("video.paused && myview.pulse") - stopped in range(6)
    assert visit.server.site.opened == [1], "nobody looks at what comes"
    return stopped


async def test_however_long_a_picture_is_paused_it_stays_so(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.keyboard.press("Space")
        stopped = await left_for_long(visit)
        await visit.page.keyboard.press("Space")
        assert await first_after(visit, stopped) < stopped + 2 * FPS


@pytest.mark.parametrize(
    "awake",
    ["video.play()", f"{HIDDEN.format('false')} && document.dispatchEvent(new Event('visibilitychange'))"],
)
async def test_what_a_browser_paused_unseen_is_live_when_somebody_looks(browser: Browser, awake: str) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        asked: list[str] = []
        visit.page.on("request", lambda request: asked.append(request.url))
        await visit.get(f"{HIDDEN.format('true')} && video.pause()")
        stopped = await left_for_long(visit)
        await visit.get(awake)
        await visit.until(f"myview.pulse > {stopped + 30 * FPS}")
        assert not any("from=" in address for address in asked)


async def test_a_past_that_comes_slowly_is_shown(browser: Browser) -> None:
    comes = asyncio.Event()
    async with visiting(browser, FakeSite(recorded=1800, past_comes=comes)) as visit:
        await visit.playing(1)
        await visit.page.keyboard.press("Space")
        await visit.until("video.paused && myview.state === 'paused'")
        await visit.page.get_by_label("How much of the past the band shows").select_option("Last 10 minutes")
        stopped = await visit.get("myview.pulse")
        strip = visit.page.locator("#strip")
        box = await strip.bounding_box()
        assert box is not None
        # In the middle of a GOP: its first frame is not the one that is wished for.
        x = next(x for x in count(100) if 4 <= (stopped + (x / box["width"] * 620 - 600) * FPS) % GOP <= 6)
        await strip.click(position={"x": x, "y": 5})
        await visit.until("video.buffered.length && video.buffered.start(0) < video.currentTime - 100")
        comes.set()
        await visit.until(f"myview.pulse < {stopped - 100 * FPS}")


async def test_the_band_reaches_back_over_all_that_is_recorded(browser: Browser) -> None:
    async with visiting(browser, FakeSite(recorded=1800)) as visit:
        await visit.playing(1)
        span = visit.page.get_by_label("How much of the past the band shows")
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


async def test_who_was_paused_while_the_site_began_anew_is_live(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.keyboard.press("Space")
        await visit.until("video.paused")
        stopped = await visit.get("myview.pulse")
        await visit.server.restart_as(FakeSite(first_pulse=500))
        began_anew = "Math.abs(myview.site.pulse0 - Date.now() / 1000) < 40"
        await visit.until(f"myview.state === 'paused' && {began_anew}")
        await visit.page.wait_for_timeout(1000)
        assert await visit.get("video.paused && myview.pulse") - stopped in range(6), "the picture stays"
        await visit.page.keyboard.press("Space")
        await visit.until(f"!video.paused && myview.pulse < 2000 && {LIVE}")
        await expect(visit.page.locator("#notice")).to_be_empty()


async def test_who_plays_on_in_a_window_of_its_own_is_where_they_stopped(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.get("video.pause()")
        stopped = await visit.get("myview.pulse")
        visit.server.site.ahead = 20
        await visit.until("video.buffered.end(video.buffered.length - 1) > video.currentTime + 15")
        await visit.get("video.play()")
        await visit.until(f"!video.paused && myview.pulse > {stopped + FPS}")
        assert await visit.get("myview.pulse") < stopped + 5 * FPS
        await expect(visit.page.get_by_role("button", name="Live", exact=True)).to_be_visible()


@pytest.mark.slow
async def test_the_past_goes_on_where_its_stream_broke(browser: Browser) -> None:
    async with visiting(browser) as visit:
        back = await some_seconds_back(visit)
        await visit.server.break_streams()
        await visit.until(f"myview.pulse > {back + 6 * FPS}")
        assert await visit.get("myview.delays.at(-1).delayMs") > 4000
        await expect(visit.page.locator("#notice")).to_be_empty()


async def test_who_was_paused_after_somebody_had_left_has_lost_nothing(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.keyboard.press("Space")
        visit.server.site.people = {1: False, 2: True}
        visit.server.site.kept_from = STARTS_AT + 100_000
        await left_for_long(visit)
        await visit.page.keyboard.press("Space")
        await visit.until(f"!video.paused && {LIVE}")
        await expect(visit.page.locator("#notice")).to_be_empty()


async def test_what_is_not_kept_is_said_and_live_goes_on(browser: Browser) -> None:
    async with visiting(browser, FakeSite(kept_from=STARTS_AT + 10_000)) as visit:
        await visit.playing(1)
        await seconds_of_playing(visit, 3)
        await visit.page.keyboard.press(",")
        await expect(visit.page.locator("#notice")).to_contain_text("Nothing is recorded of that time")
        seen = await visit.get("myview.pulse")
        await visit.until(f"myview.pulse > {seen + GOP} && {LIVE}")


@pytest.mark.slow
async def test_another_person_is_watched_at_the_same_moment_of_the_past(browser: Browser) -> None:
    async with visiting(browser) as visit:
        back = await some_seconds_back(visit)
        async with visit.page.expect_request(lambda request: "choice?at=p" in request.url):
            await visit.until(f"myview.pulse > {back + 2 * FPS}")
        await visit.page.keyboard.press("ArrowRight")
        await visit.playing(2)
        assert await visit.get("myview.pulse") > back + FPS, "goes on from the moment shown"
        await visit.until("myview.delays.at(-1).delayMs > 4000 && myview.camera === 'c2'")
        await visit.page.keyboard.press("1")
        await visit.until("myview.delays.at(-1).delayMs > 4000 && myview.camera === 'c0'")
