"""The page lists people at other sites and in other areas, and goes with the selected person there."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import visiting
from fakes.page.site import FakeSite, serving
from fakes.programs import needs_chromium
from fakes.timeouts import PATIENCE_MS

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]


async def test_the_page_goes_with_the_selected_person_and_shows_the_others(browser: Browser) -> None:
    hall, yard = FakeSite(), FakeSite(people={1: True, 7: True})
    async with serving(yard) as there, visiting(browser, hall, "?object=1") as visit:
        at_yard = {"server": there.url, "site": "yard", "token": False}
        await visit.playing(1)
        hall.elsewhere = [
            {"object": 7, "visible": True, **at_yard},
            {"object": 9, "visible": False, **at_yard},
            {"object": 4, "server": "http://two/", "site": None, "visible": None, "token": False},
            {"object": 6, "server": "http://two/", "site": None, "visible": True, "token": False},
            {"object": 8, "server": "http://two/", "site": None, "visible": False, "token": False},
            {"object": 5, "server": "javascript:alert(1)", "site": "yard", "visible": True, "token": False},
        ]
        await expect(visit.page.locator("#elsewhere li")).to_have_text(
            [
                "Person 7 at yard",
                "Person 9 left yard",
                "Person 6 in another area",
                "Person 8 was in another area",
            ]
        )
        assert visit.page.url.endswith("?object=1"), "who is here is not looked for elsewhere"
        hall.people = {1: False, 2: True}
        hall.elsewhere = [{"object": 1, "visible": True, **at_yard}]
        await visit.page.wait_for_url(f"{there.url}?object=1", timeout=PATIENCE_MS)
        await visit.playing(1)


async def test_a_page_on_which_nobody_was_selected_stays(browser: Browser) -> None:
    hall = FakeSite()
    async with visiting(browser, hall) as visit:
        await visit.playing(1)
        hall.people = {1: False, 2: True}
        hall.elsewhere = [
            {"object": 1, "server": "http://127.0.0.1:9/", "site": "yard", "visible": True, "token": False}
        ]
        await expect(visit.page.get_by_role("link", name="Person 1")).to_be_visible()
        await visit.until("performance.now() > 5000")
        assert "127.0.0.1:9" not in visit.page.url
