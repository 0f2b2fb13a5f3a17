"""Corrected identities: the page stays with the person, and a notice explains the change."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import visiting
from fakes.page.site import FakeSite
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]


async def test_the_selected_person_stays_selected_when_their_number_is_merged(browser: Browser) -> None:
    async with visiting(browser, query="?object=2") as visit:
        await visit.playing(2)
        site = visit.server.site
        site.aliases = {1: [2]}
        site.people = {1: True}
        await visit.playing(1)
        assert visit.page.url.endswith("?object=1")
        await expect(visit.page.locator("#notice")).to_have_text("Person 2 is the same as person 1.")
        await expect(visit.page.locator("nav .person")).to_have_count(1)


async def test_a_link_to_a_merged_number_opens_on_the_kept_one(browser: Browser) -> None:
    async with visiting(browser, FakeSite(people={1: True}, aliases={1: [7]}), "?object=7") as visit:
        await visit.playing(1)
        assert visit.page.url.endswith("?object=1")


async def test_a_split_of_the_selected_person_is_explained(browser: Browser) -> None:
    async with visiting(browser, query="?object=1") as visit:
        await visit.playing(1)
        await expect(visit.page.locator("#notice")).to_be_empty()
        visit.server.site.split = [{"kept": 1, "new_object": 2, "camera": "c0"}]
        await expect(visit.page.locator("#notice")).to_have_text("c0 mistook person 2 for person 1.")
        await expect(visit.page.locator("#reason")).to_be_hidden()
        await visit.playing(1)
