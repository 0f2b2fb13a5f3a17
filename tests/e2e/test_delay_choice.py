"""A viewer changes the delay on the page of a real site: the picture goes on, as late as was chosen."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.async_api import expect

from benchmarks.common.browser import chromium
from fakes.page.browser import new_page
from fakes.programs import needs_chromium
from fakes.running.several_services import configuration, several_services

pytestmark = [pytest.mark.live, pytest.mark.slow, needs_chromium, pytest.mark.asyncio]

SMOOTH_S = 3.0
"""Look-ahead of the smooth view, in seconds: no picture of it is shown earlier."""
BEHIND_S = """(() => {
  const last = myview.delays.slice(-5).map((it) => it.delayMs / 1000).sort((a, b) => a - b);
  return myview.state === 'playing' && last.length === 5 ? last[2] : null;
})()"""


async def test_the_picture_is_as_late_as_the_chosen_delay(tmp_path: Path) -> None:
    # Simulated cameras keep up with the pulses on a busy machine, too.
    async with several_services(configuration(tmp_path, services=1)) as site, chromium() as browser:
        await site.numbers(0)
        page = await new_page(browser, bypass_csp=True)
        await page.goto(site.urls[0])
        choice = page.get_by_label("Delay", exact=True)
        await page.wait_for_function(f"{BEHIND_S} > 0.9")
        await expect(choice.locator("option")).to_have_count(3)
        await choice.select_option("smooth")
        await page.wait_for_function(f"{BEHIND_S} > {SMOOTH_S}")
        assert "delay=smooth" in page.url
        smooth = await page.evaluate(BEHIND_S)
        await choice.select_option("live")
        await page.wait_for_function(f"{BEHIND_S} !== null && {BEHIND_S} < {smooth} - {SMOOTH_S / 2}")
        await choice.select_option("balanced")
        await page.wait_for_function(f"{BEHIND_S} > 0.9")
        assert "delay=" not in page.url
        await expect(choice.locator("option").first).to_contain_text("Live · ")
