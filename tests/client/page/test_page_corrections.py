"""Numbers that turn out to be wrong: the page goes on with the person, and says so."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import visiting
from fakes.page.site import FakeSite
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]


async def test_whoever_is_watched_stays_when_their_number_is_merged(browser: Browser) -> None:
    async with visiting(browser, query="?object=2") as visit:
        await visit.playing(2)
        site = visit.server.site
        site.aliases = {1: [2]}
        site.people = {1: True}
        await visit.playing(1)
        assert visit.page.url.endswith("?object=1")
        await expect(visit.page.locator("#notice")).to_have_text("Person 2 turned out to be person 1.")
        await expect(visit.page.locator("nav .person")).to_have_count(1)


async def test_a_link_to_a_merged_number_opens_on_who_it_is(browser: Browser) -> None:
    async with visiting(browser, FakeSite(people={1: True}, aliases={1: [7]}), "?object=7") as visit:
        await visit.playing(1)
        assert visit.page.url.endswith("?object=1")


async def test_somebody_else_under_the_watched_number_is_named(browser: Browser) -> None:
    async with visiting(browser, query="?object=1") as visit:
        await visit.playing(1)
        await expect(visit.page.locator("#notice")).to_be_empty()
        visit.server.site.split = [{"kept": 1, "new_object": 2, "camera": "c0"}]
        await expect(visit.page.locator("#notice")).to_have_text(
            "c0 took somebody else for person 1: that is person 2."
        )
        await expect(visit.page.locator("#reason")).to_be_hidden()
        await visit.playing(1)
