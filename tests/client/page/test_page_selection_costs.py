"""The cost table: of the displayed view by the Why button, of another moment by the mouse on the timeline."""

from __future__ import annotations

import asyncio

import pytest
from playwright.async_api import Browser, Route, expect

from fakes.page.browser import visiting
from fakes.page.site import FIRST_PULSE, FakeSite
from fakes.page.video_pattern import FPS
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]


async def test_the_why_button_shows_the_costs_of_every_camera(browser: Browser) -> None:
    async with visiting(browser, query="?object=2") as visit:
        await visit.playing(2)
        await visit.page.keyboard.press("w")
        costs_button = visit.page.locator("#why")
        await expect(costs_button).to_contain_text("Now: c2.")
        await expect(costs_button.locator("tbody tr")).to_have_count(3)
        await expect(costs_button.locator("tr[aria-current]")).to_have_text("c20.001.001.001.00")
        await expect(costs_button.locator("tbody tr").nth(1)).to_contain_text("0.500.501.00")
        await expect(costs_button).to_contain_text("A cut costs as much as 0.3 s of not seeing the person.")
        await expect(costs_button).to_contain_text("Over 0.4 s: staying with c2 0 s, c0 0.37 s with its cut.")
        table = await costs_button.bounding_box()
        legend = await visit.page.locator(".legend").bounding_box()
        assert table is not None
        assert legend is not None
        assert table["y"] + table["height"] <= legend["y"], "it covers no controls"
        await visit.page.get_by_role("button", name="Why").click()
        await expect(costs_button).to_be_hidden()


async def test_undetected_shares_have_their_own_column(browser: Browser) -> None:
    async with visiting(browser, FakeSite(undetected=0.25), query="?object=2") as visit:
        await visit.playing(2)
        await visit.page.keyboard.press("w")
        costs_button = visit.page.locator("#why")
        await expect(costs_button.locator("thead")).to_have_text("cameracostseesundetectedsizetruncation")
        await expect(costs_button.locator("tr[aria-current]")).to_have_text("c20.001.000.251.001.00")


async def test_the_mouse_on_the_timeline_shows_the_costs_of_that_moment(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        pulse = await visit.get("myview.pulse")
        await visit.until(f"myview.pulse > {pulse + 5 * FPS}")
        strip = visit.page.locator("#strip")
        box = await strip.bounding_box()
        assert box is not None
        await strip.hover(position={"x": box["width"] * (60 - 3) / 62, "y": 5})
        costs_button = visit.page.locator("#why")
        await expect(costs_button).to_contain_text("s before: c")
        text = await costs_button.locator("p").first.text_content() or ""
        assert 2 < float(text.split(maxsplit=1)[0]) < 15
        await visit.page.mouse.move(5, 5)
        await expect(costs_button).to_be_hidden()


async def test_with_slow_answers_the_costs_are_of_the_last_mouse_position(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)

        async def delay(route: Route) -> None:
            await asyncio.sleep(0.4)
            await route.continue_()

        await visit.page.route("**/choice?at=*", delay)
        box = await visit.page.locator("#strip").bounding_box()
        assert box is not None
        for seconds in (10, 30):
            await visit.page.mouse.move(box["x"] + box["width"] * (60 - seconds) / 62, box["y"] + 5)
        text = visit.page.locator("#why p").first
        await expect(text).to_contain_text("s before: c")
        assert 28 < float((await text.text_content() or "").split(maxsplit=1)[0]) < 45


async def test_a_moment_without_recorded_reasons_says_so(browser: Browser) -> None:
    async with visiting(browser, FakeSite(replayable_from=FIRST_PULSE + 100_000)) as visit:
        await visit.playing(1)
        await visit.page.keyboard.press("w")
        await expect(visit.page.locator("#why")).to_contain_text("not known")
