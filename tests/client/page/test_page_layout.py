"""Layout of the page on a phone, a tablet and a desktop: no overflow, no layout shifts."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import new_page, visiting
from fakes.page.site import FakeSite, serving
from fakes.page.video_pattern import HEIGHT, WIDTH
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]

MANY = {person: person % 4 != 0 for person in range(1, 24)}
# On a slow machine the status over the picture may change several times: no layout shift.
WATCH_SHIFTS = """
    window.shifts = [];
    const inStatus = ({ node }) => document.querySelector('#status').contains(node);
    new PerformanceObserver((list) => {
      for (const entry of list.getEntries()) if (!entry.sources.every(inStatus)) shifts.push(entry.value);
    }).observe({ type: 'layout-shift', buffered: true });
"""


@pytest.mark.parametrize("people", [{}, MANY], ids=["empty", "many"])
@pytest.mark.parametrize(("width", "height"), [(360, 740), (740, 360), (800, 900), (1600, 900)])
async def test_nothing_needs_horizontal_scrolling(
    browser: Browser, width: int, height: int, people: dict[int, bool]
) -> None:
    site = FakeSite(people=dict(people))
    async with visiting(browser, site, width=width, height=height) as visit:
        await visit.until(f"myview.state === '{'playing' if people else 'empty'}'")
        if people:
            await visit.until("document.querySelector('#reason').textContent.length > 60")
        assert await visit.get("document.documentElement.scrollWidth") <= width
        stage = await visit.page.locator("#stage").bounding_box()
        assert stage is not None
        assert stage["x"] >= 0
        assert stage["x"] + stage["width"] <= width
        assert stage["width"] / stage["height"] == pytest.approx(WIDTH / HEIGHT, rel=0.01)


@pytest.mark.parametrize("shown", ["#tiles", "#why table"])
async def test_on_a_desktop_everything_fits_without_scrolling(browser: Browser, shown: str) -> None:
    async with visiting(browser, width=1600, height=900) as visit:
        await visit.playing(1)
        if shown == "#tiles":
            await visit.page.get_by_role("button", name="Person 2 beside the large picture").click()
        else:
            await visit.page.keyboard.press("w")
        await expect(visit.page.locator(shown)).to_be_visible()
        for part in ("#stage", shown, "#pause", "#strip", ".legend"):
            await expect(visit.page.locator(part)).to_be_in_viewport(ratio=1)


@pytest.mark.parametrize(("width", "slowness"), [(360, 1), (360, 20), (1600, 1)])
async def test_opening_and_switching_cause_no_layout_shifts(
    browser: Browser, width: int, slowness: int
) -> None:
    """At a 20th of the speed the page appears before the site is known."""
    async with visiting(browser, width=width, slowness=slowness) as visit:
        await visit.get(f"{{ {WATCH_SHIFTS} }}")
        await visit.playing(1)
        await visit.until("myview.cuts.length >= 1")
        await visit.page.keyboard.press("ArrowRight")
        await visit.playing(2)
        shifts = await visit.get("shifts")
        assert sum(shifts) < 0.01


async def test_controls_are_large_enough_for_a_thumb(browser: Browser) -> None:
    async with visiting(browser, width=360, height=740) as visit:
        await visit.playing(1)
        for button in await visit.page.get_by_role("button").all():
            box = await button.bounding_box()
            assert box is not None
            assert min(box["width"], box["height"]) >= 44


async def test_every_control_has_an_accessible_name(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        snapshot = await visit.page.locator("body").aria_snapshot()
        assert 'button "Person 1, seen by c0, c1"' in snapshot
        assert 'button "Boxes" [pressed]' in snapshot
        assert 'button "Full screen"' in snapshot
        assert "- status" in snapshot
        assert 'navigation "People"' in snapshot


async def test_all_requests_go_to_the_server_within_its_content_policy(browser: Browser) -> None:
    async with serving(FakeSite()) as server:
        page = await new_page(browser)
        messages: list[str] = []
        requests: list[str] = []
        page.on("console", lambda message: messages.append(message.text))
        page.on("request", lambda request: requests.append(request.url))
        await page.goto(server.url)
        await expect(page.locator("#stage")).to_have_attribute("data-state", "playing")
        await expect(page.locator("#camera")).not_to_be_empty()
        await page.close()
    assert messages == []
    assert all(url.startswith((server.url, f"blob:{server.url}", "data:")) for url in requests)
