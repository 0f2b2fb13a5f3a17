"""A camera held by hand: it stays, the page says so, and automatic is one press away."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import Visit, camera_on_the_stage, visiting
from fakes.page.site import HOLD
from fakes.page.video_pattern import CAMERAS, GOP
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]


async def stays(visit: Visit, camera: str) -> None:
    """Check that a camera is shown for as long as the best view would have gone through all of them."""
    await visit.until(f"myview.camera === '{camera}'")
    seen = await visit.get("myview.pulse")
    cuts = await visit.get("myview.cuts.length")
    for later in range(HOLD, len(CAMERAS) * HOLD + 1, HOLD):
        await visit.until(f"myview.pulse > {seen + later}")
        assert await camera_on_the_stage(visit) == camera
    assert await visit.get("myview.cuts.length") == cuts


async def test_a_held_camera_stays_until_automatic_is_pressed(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.get("window.before = [video, video.currentSrc]")
        await visit.page.get_by_role("button", name="c1", exact=True).click()
        await stays(visit, "c1")
        await expect(visit.page.locator("#reason")).to_contain_text("Held by hand.")
        assert visit.page.url.endswith("?object=1&camera=c1")
        await visit.page.get_by_role("button", name="Automatic").click()
        await visit.until("new Set(myview.cuts.slice(-2).map((cut) => cut.to)).size > 1")
        assert visit.page.url.endswith("?object=1")
        await expect(visit.page.get_by_role("button", name="Automatic")).to_be_hidden()
        assert await visit.get("video === window.before[0] && video.currentSrc === window.before[1]")


@pytest.mark.slow
async def test_a_link_and_keys_hold_too_and_another_person_is_automatic(browser: Browser) -> None:
    async with visiting(browser, query="?object=1&camera=c0") as visit:
        await visit.playing(1)
        await stays(visit, "c0")
        await visit.page.keyboard.press("3")
        await visit.until("myview.camera === 'c2'")
        await visit.page.keyboard.press("ArrowRight")
        await visit.playing(2)
        assert visit.page.url.endswith("?object=2")
        await visit.page.go_back()
        await visit.until("myview.object === 1 && myview.camera === 'c2'")


async def test_a_preferred_camera_gives_way_where_it_does_not_see_the_person(browser: Browser) -> None:
    async with visiting(browser, query="?object=2&camera=c0") as visit:
        await visit.playing(2)
        await visit.page.get_by_role("button", name="Prefer").click()
        assert visit.page.url.endswith("?object=2&prefer=c0")
        await visit.until("myview.camera === 'c0' && myview.delays.length")
        assert await camera_on_the_stage(visit) == "c0"
        await expect(visit.page.locator("#reason")).to_have_text("Preferred. The best view now is c2.")
        site = visit.server.site
        first = site.edge - site.edge % GOP + 3 * GOP
        site.blind = range(first, first + 10_000 * GOP)  # until it has been looked at
        await visit.until(f"myview.pulse > {first + GOP}")
        assert await visit.get("myview.camera") == "c2"
        assert await camera_on_the_stage(visit) == "c2"
        await expect(visit.page.locator("#reason")).to_contain_text("does not see this person")
        site.blind = range(first, site.edge - site.edge % GOP + 3 * GOP)
        await visit.until(f"myview.pulse > {site.blind.stop + GOP}")
        cuts = await visit.get("myview.cuts.slice(-2)")
        assert [it["to"] for it in cuts] == ["c2", "c0"]
        for cut, since in zip(cuts, (first, site.blind.stop + GOP), strict=True):
            assert 0 <= cut["pulse"] - since < GOP, "a slow core may leave the very first frame out"
        await visit.page.get_by_role("button", name="Prefer").click()
        await visit.until("new URL(location).searchParams.get('camera') === 'c0'")
        await visit.page.keyboard.press("0")
        await visit.until("myview.camera === 'c2'")


async def test_a_camera_that_is_not_there_is_held_by_nobody(browser: Browser) -> None:
    async with visiting(browser, query="?object=1&camera=c9") as visit:
        await visit.playing(1)
        await visit.until("myview.cuts.length > 1")
