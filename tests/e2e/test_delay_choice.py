"""A viewer changes the delay on the page of a real site: the picture goes on, as late as was chosen."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import expect

from benchmarks.common.browser import chromium
from fakes.page.browser import new_page
from fakes.programs import needs_chromium
from fakes.running.site import RunningSite, configuration, running

pytestmark = [pytest.mark.live, needs_chromium, pytest.mark.asyncio(loop_scope="module")]

BEHIND_S = """(() => {
  const last = myview.delays.slice(-5).map((it) => it.delayMs / 1000).sort((a, b) => a - b);
  return myview.state === 'playing' && last.length === 5 ? last[2] : null;
})()"""


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def site(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[RunningSite]:
    config = configuration(tmp_path_factory.mktemp("site"), recording, camera={"at_end": "loop"})
    async with running(config) as site:
        await site.until(lambda: bool(site.gops and site.gops[-1].choices), "a person is shown")
        yield site


async def test_the_picture_is_as_late_as_the_chosen_delay(site: RunningSite) -> None:
    async with chromium() as browser:
        page = await new_page(browser, bypass_csp=True)
        await page.goto(site.url)
        choice = page.get_by_label("Delay", exact=True)
        await page.wait_for_function(f"{BEHIND_S} > 0.9")
        await expect(choice.locator("option")).to_have_count(3)
        await choice.select_option("smooth")
        await page.wait_for_function(f"{BEHIND_S} > 2.5")
        assert "delay=smooth" in page.url
        balanced = await page.evaluate(BEHIND_S)
        await choice.select_option("live")
        await page.wait_for_function(f"{BEHIND_S} !== null && {BEHIND_S} < {balanced} - 1.5")
        await choice.select_option("balanced")
        await page.wait_for_function(f"{BEHIND_S} > 0.9")
        assert "delay=" not in page.url
        await expect(choice.locator("option").first).to_contain_text("Live · ")
