"""Accessibility: axe-core finds no serious fault in any state of the page."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser

from fakes.page.accessibility import violations
from fakes.page.browser import visiting
from fakes.page.site import FakeSite
from fakes.paths import AXE
from fakes.programs import needs_chromium

pytestmark = [
    needs_chromium,
    pytest.mark.skipif(not AXE.exists(), reason="needs axe-core: make node_modules/.installed"),
    pytest.mark.asyncio(loop_scope="session"),
]


@pytest.mark.parametrize("width", [360, 1600])
async def test_a_page_with_a_selected_person_has_no_faults(browser: Browser, width: int) -> None:
    async with visiting(browser, FakeSite(people={1: True, 2: False}), width=width) as visit:
        await visit.playing(1)
        await visit.page.get_by_text("More", exact=True).click()
        await visit.page.keyboard.press("w")
        await visit.until("document.querySelector('#why table')")
        assert await violations(visit) == []


async def test_the_cost_table_is_focused_and_scrolled_by_keyboard(browser: Browser) -> None:
    async with visiting(browser, width=360) as visit:
        await visit.playing(1)
        await visit.page.add_style_tag(
            content=".why table { width: 900px }"
        )  # as with many cameras and terms
        await visit.page.keyboard.press("w")
        await visit.until("document.querySelector('#why table')")
        await visit.page.get_by_role("region", name="Why this view").focus()
        await visit.page.keyboard.press("ArrowRight")
        await visit.until("document.querySelector('#why').scrollLeft > 0 && myview.object === 1")


@pytest.mark.parametrize(("people", "query"), [({}, ""), ({1: False}, "?object=1"), ({1: True}, "?object=9")])
async def test_a_page_without_a_visible_person_has_no_faults(
    browser: Browser, people: dict[int, bool], query: str
) -> None:
    async with visiting(browser, FakeSite(people=people), query) as visit:
        await visit.until("['empty', 'away', 'unknown'].includes(myview.state)")
        assert await violations(visit) == []
