"""The search of the past: stays are listed with pictures, and a press plays the best view of that moment."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser, expect

from fakes.page.accessibility import violations
from fakes.page.browser import play_for, visiting
from fakes.page.site import FIRST_PULSE, FakeSite
from fakes.page.video_pattern import FPS
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]


async def test_a_stay_that_is_found_is_pictured_and_played(browser: Browser) -> None:
    first = FIRST_PULSE - 60 * FPS
    site = FakeSite(people={1: True, 2: False}, recorded=1800)
    site.stays = [
        {"object": 2, "zone": "till", "first": first, "frames": 10 * FPS},
        {"object": 2, "zone": "till", "first": first + 10 * FPS, "frames": 5 * FPS},
        {
            "object": 7,
            "run": "20261121T161336Z",
            "camera": "c1",
            "first": 9,
            "frames": FPS,
            "clip": "clip.mp4",
        },
    ]
    async with visiting(browser, site, width=1280) as visit:
        await visit.playing(1)
        page = visit.page
        await page.get_by_text("Search the past").click()
        await page.get_by_label("Where").select_option(label="Zone till")
        await page.get_by_label("Who").select_option(label="Person 2")
        await page.get_by_role("button", name="Search", exact=True).click()
        stays = page.get_by_role("list", name="Stays").get_by_role("listitem")
        await expect(stays).to_have_count(2)
        await expect(page.locator("#search-status")).to_have_text(
            "2 stays of 2 people, 16 s in all. Zones are where they are today."
        )
        asked, continued, _ = site.searched
        assert (asked["zone"], asked["object"], asked["from"], asked["order"]) == (
            "till",
            "2",
            "-3600",
            "newest",
        )
        assert continued["from"] == f"p{first + 10 * FPS}"
        await expect(stays.first).to_contain_text("Person 2till")
        await expect(stays.first).to_contain_text("15 s")
        await expect(stays.last.get_by_role("link")).to_have_attribute("href", "clip.mp4")
        await visit.until("document.querySelector('#search-stays canvas.drawn')")
        assert await violations(visit) == []
        await stays.first.get_by_role("button").click()
        await visit.until(
            f"myview.object === 2 && myview.pulse >= {first} && myview.pulse < {first + 20 * FPS}"
        )
        await play_for(visit, 1)
        await page.get_by_role("button", name="Live", exact=True).click()
        await visit.until(f"myview.pulse > {FIRST_PULSE}")


async def test_a_refused_search_says_why(browser: Browser) -> None:
    async with visiting(browser, FakeSite()) as visit:
        await visit.playing(1)
        await visit.page.get_by_text("Search the past").click()
        search = visit.page.get_by_role("button", name="Search", exact=True)
        await search.click()
        status = visit.page.locator("#search-status")
        await expect(status).to_have_text("zone: 'till': there is no such area")
        await visit.page.get_by_label("When").select_option(label="Between…")
        await visit.page.get_by_label("From").fill("2026-11-21T16:13:36")
        await visit.page.get_by_label("To", exact=True).fill("2026-11-21T16:13:35")
        await search.click()
        await expect(status).to_have_text("The end is not after the start.")
        assert len(visit.server.site.searched) == 1
