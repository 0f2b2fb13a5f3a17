"""The page in a real browser on a real site: it plays across cuts, and the server may go and come back."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from pathlib import Path

import aiohttp
import numpy as np
import pytest
import pytest_asyncio
from beeps import heard
from patience import PATIENCE
from playwright.async_api import Browser, Page
from programs import needs_chromium
from running_site import RunningSite, bounded
from spliced import FPS, record

from benchmarks.browser import chromium

pytestmark = [
    pytest.mark.live,
    pytest.mark.asyncio(loop_scope="session"),
    needs_chromium,
]

PLAYED_ACROSS_A_CUT = f"""(() => {{
  const shown = myview.delays.map((it) => it.pulse);
  return myview.cuts.some(({{ pulse: cut }}) => {{
    const [from, to] = [cut - {FPS}, cut + {FPS}];
    const around = [from, ...shown.filter((it) => from < it && it < to), to];
    const steps = around.slice(1).map((it, k) => it - around[k]);
    return shown.at(-1) >= to && steps.every((step) => 0 <= step && step < {FPS // 2});
  }});
}})()"""


@pytest_asyncio.fixture(scope="module", loop_scope="session")
async def browser() -> AsyncIterator[Browser]:
    async with chromium() as running:
        yield running


@pytest_asyncio.fixture(loop_scope="session")
async def page(site: RunningSite, browser: Browser) -> AsyncIterator[Page]:
    """The page, opened; an error in it fails the test."""
    errors: list[str] = []
    # Waiting for a condition in the page evaluates it as a string, which the page's policy forbids.
    page = await browser.new_page(bypass_csp=True)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.set_default_timeout(1000 * PATIENCE)
    await page.goto(site.url)
    yield page
    await page.close()
    assert errors == []


async def test_the_best_view_plays_across_a_cut_and_the_frames_go_on(page: Page) -> None:
    await page.wait_for_function("myview.state === 'playing'")
    # Whoever has left for good is never cut to again: then somebody in view is chosen.
    somebody = "document.querySelector('#people button.person:not(.away)')?.click()"
    # A slow core leaves frames out, and now and then the page jumps to live; it never stops at each cut.
    await page.wait_for_function(f"{PLAYED_ACROSS_A_CUT} || (myview.state === 'away' && {somebody}, false)")


@pytest.mark.slow
async def test_the_sound_goes_on_across_cuts_and_choices_in_step(
    page: Page, site: RunningSite, tmp_path: Path
) -> None:
    await page.wait_for_function("myview.state === 'playing'")
    video = "document.querySelector('video')"
    assert await page.evaluate(f"{video}.muted"), "or it would not play by itself"
    await page.get_by_role("button", name="Sound").click()
    assert not await page.evaluate(f"{video}.muted")
    before = await page.evaluate(f"{video}.webkitAudioDecodedByteCount")
    await page.locator("#people button.person:not(.away)[aria-current=false]").first.click()
    more = f"{video}.webkitAudioDecodedByteCount > {before} + 5000"
    await page.wait_for_function(f"myview.state === 'playing' && {more}")
    number = await page.evaluate("myview.object")
    async with aiohttp.ClientSession() as session:
        url = f"{site.url}objects/{number}/best.mp4"
        film = await bounded(record(session, url, site.pulse + 4 * FPS, tmp_path / "film"))
    times, begins = await asyncio.to_thread(heard, film)
    assert np.diff(times) == pytest.approx(1 / 48_000, abs=1e-4), "without a hole"
    assert len(begins) >= 3
    assert [begin - round(begin) for begin in begins] == pytest.approx([0] * len(begins), abs=0.04)


async def test_choosing_somebody_else_shows_them_without_another_player(page: Page) -> None:
    await page.wait_for_function("myview.state === 'playing'")
    await page.evaluate("document.querySelector('video').dataset.same = 'yes'")
    first = await page.evaluate("myview.object")
    in_view = page.locator("#people button.person:not(.away)[aria-current=false]")
    await in_view.first.click()
    await page.wait_for_function(f"myview.object !== {first} && myview.state === 'playing'")
    assert await page.evaluate("document.querySelector('video').dataset.same") == "yes"


async def test_the_page_plays_again_after_the_best_view_process_was_killed(
    page: Page, site: RunningSite
) -> None:
    await page.wait_for_function("myview.state === 'playing'")
    os.kill(site.children()["bestview"], signal.SIGKILL)
    await page.wait_for_function("myview.state !== 'playing'")
    await page.wait_for_function("myview.state === 'playing'")
    pulse = await page.evaluate("myview.pulse")
    await page.wait_for_function(f"myview.pulse > {pulse} + 10")
