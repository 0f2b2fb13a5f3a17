"""The numbers behind a view: of the present one by a button, of another moment under the mouse."""

from __future__ import annotations

import asyncio

import pytest
from playwright.async_api import Browser, Route, expect

from fakes.page.browser import visiting
from fakes.page.site import STARTS_AT, FakeSite
from fakes.page.video_pattern import FPS
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]


async def test_the_present_view_is_explained_camera_by_camera(browser: Browser) -> None:
    async with visiting(browser, query="?object=2") as visit:
        await visit.playing(2)
        await visit.page.keyboard.press("w")
        why = visit.page.locator("#why")
        await expect(why).to_contain_text("Now: c2.")
        await expect(why.locator("tbody tr")).to_have_count(3)
        await expect(why.locator("tr[aria-current]")).to_have_text("c20.001.001.001.00")
        await expect(why.locator("tbody tr").nth(1)).to_contain_text("0.500.501.00")
        await expect(why).to_contain_text("A cut costs as much as 7.5 frames of not seeing the person.")
        await expect(why).to_contain_text("Over 10 frames: staying with c2 0, c0 9.3 with its cut.")
        table = await why.bounding_box()
        legend = await visit.page.locator(".legend").bounding_box()
        assert table is not None
        assert legend is not None
        assert table["y"] + table["height"] <= legend["y"], "it lies over nothing that can be pressed"
        await visit.page.get_by_role("button", name="Why").click()
        await expect(why).to_be_hidden()


async def test_where_somebody_is_not_found_that_is_a_column_of_its_own(browser: Browser) -> None:
    async with visiting(browser, FakeSite(undetected=0.25), query="?object=2") as visit:
        await visit.playing(2)
        await visit.page.keyboard.press("w")
        why = visit.page.locator("#why")
        await expect(why.locator("thead")).to_have_text("cameracostseesundetectedsizetruncation")
        await expect(why.locator("tr[aria-current]")).to_have_text("c20.001.000.251.001.00")


async def test_a_moment_under_the_mouse_is_explained(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        seen = await visit.get("myview.pulse")
        await visit.until(f"myview.pulse > {seen + 5 * FPS}")
        strip = visit.page.locator("#strip")
        box = await strip.bounding_box()
        assert box is not None
        await strip.hover(position={"x": box["width"] * (60 - 3) / 62, "y": 5})
        why = visit.page.locator("#why")
        await expect(why).to_contain_text("s before: c")
        words = await why.locator("p").first.text_content() or ""
        assert 2 < float(words.split(maxsplit=1)[0]) < 15
        await visit.page.mouse.move(5, 5)
        await expect(why).to_be_hidden()


async def test_where_the_mouse_comes_to_rest_is_explained_though_answers_are_slow(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)

        async def late(route: Route) -> None:
            await asyncio.sleep(0.4)
            await route.continue_()

        await visit.page.route("**/choice?at=*", late)
        box = await visit.page.locator("#strip").bounding_box()
        assert box is not None
        for seconds in (10, 30):
            await visit.page.mouse.move(box["x"] + box["width"] * (60 - seconds) / 62, box["y"] + 5)
        words = visit.page.locator("#why p").first
        await expect(words).to_contain_text("s before: c")
        assert 28 < float((await words.text_content() or "").split(maxsplit=1)[0]) < 45


async def test_a_moment_whose_reasons_are_not_kept_is_said(browser: Browser) -> None:
    async with visiting(browser, FakeSite(kept_from=STARTS_AT + 100_000)) as visit:
        await visit.playing(1)
        await visit.page.keyboard.press("w")
        await expect(visit.page.locator("#why")).to_contain_text("not known")
