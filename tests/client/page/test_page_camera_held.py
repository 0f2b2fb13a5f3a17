"""Held and preferred cameras."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import Visit, displayed_camera, visiting
from fakes.page.site import HOLD
from fakes.page.video_pattern import CAMERAS, GOP
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]


async def check_held(visit: Visit, camera: str) -> None:
    """Check that a camera stays for as long as the best view would have cut through all cameras."""
    await visit.until(f"myview.camera === '{camera}'")
    pulse = await visit.get("myview.pulse")
    cuts = await visit.get("myview.cuts.length")
    for later in range(HOLD, len(CAMERAS) * HOLD + 1, HOLD):
        await visit.until(f"myview.pulse > {pulse + later}")
        assert await displayed_camera(visit) == camera
    assert await visit.get("myview.cuts.length") == cuts


async def test_a_held_camera_stays_until_automatic_is_pressed(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.get("window.before = [video, video.currentSrc]")
        await visit.page.get_by_role("button", name="c1", exact=True).click()
        await check_held(visit, "c1")
        await expect(visit.page.locator("#reason")).to_contain_text("Held.")
        assert visit.page.url.endswith("?object=1&camera=c1")
        await visit.page.get_by_role("button", name="Automatic").click()
        await visit.until("new Set(myview.cuts.slice(-2).map((cut) => cut.to)).size > 1")
        assert visit.page.url.endswith("?object=1")
        await expect(visit.page.get_by_role("button", name="Automatic")).to_be_hidden()
        assert await visit.get("video === window.before[0] && video.currentSrc === window.before[1]")


@pytest.mark.slow
async def test_links_and_keys_hold_a_camera_and_another_person_is_automatic(browser: Browser) -> None:
    async with visiting(browser, query="?object=1&camera=c0") as visit:
        await visit.playing(1)
        await check_held(visit, "c0")
        await visit.page.keyboard.press("3")
        await visit.until("myview.camera === 'c2'")
        await visit.page.keyboard.press("ArrowRight")
        await visit.playing(2)
        assert visit.page.url.endswith("?object=2")
        await visit.page.go_back()
        await visit.until("myview.object === 1 && myview.camera === 'c2'")


async def test_a_preferred_camera_is_replaced_while_it_does_not_see_the_person(browser: Browser) -> None:
    async with visiting(browser, query="?object=2&camera=c0") as visit:
        await visit.playing(2)
        await visit.page.get_by_role("button", name="Prefer").click()
        assert visit.page.url.endswith("?object=2&prefer=c0")
        await visit.until("myview.camera === 'c0' && myview.delays.length")
        assert await displayed_camera(visit) == "c0"
        await expect(visit.page.locator("#reason")).to_have_text("Preferred. The best view now is c2.")
        site = visit.server.site
        first = site.edge - site.edge % GOP + 3 * GOP
        site.blind_pulses = range(first, first + 10_000 * GOP)  # longer than the test
        await visit.until(f"myview.pulse > {first + GOP}")
        assert await visit.get("myview.camera") == "c2"
        assert await displayed_camera(visit) == "c2"
        await expect(visit.page.locator("#reason")).to_contain_text("does not see this person")
        site.blind_pulses = range(first, site.edge - site.edge % GOP + 3 * GOP)
        await visit.until(f"myview.pulse > {site.blind_pulses.stop + GOP}")
        cuts = await visit.get("myview.cuts.slice(-2)")
        assert [cut["to"] for cut in cuts] == ["c2", "c0"]
        for cut, since in zip(cuts, (first, site.blind_pulses.stop + GOP), strict=True):
            assert 0 <= cut["pulse"] - since < 3 * GOP, "a slow machine may skip the first frames"
        await visit.page.get_by_role("button", name="Prefer").click()
        await visit.until("new URL(location).searchParams.get('camera') === 'c0'")
        await visit.page.keyboard.press("0")
        await visit.until("myview.camera === 'c2'")


async def test_an_unknown_camera_in_a_link_is_ignored(browser: Browser) -> None:
    async with visiting(browser, query="?object=1&camera=c9") as visit:
        await visit.playing(1)
        await visit.until("myview.cuts.length > 1")
