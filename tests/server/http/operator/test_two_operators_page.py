"""Two operators change a site at once, each in a browser: none overwrites unseen, nothing entered is lost."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import pytest
from playwright.async_api import Browser, Dialog, Page, expect

from fakes.page.operator_page import open_operator_page, operator_page
from fakes.programs import needs_chromium
from fakes.service.fed_site import ServedSite, apply_saved_zones, show_people
from fakes.timeouts import PATIENCE
from server.config.loader import load_config
from server.http.app_keys import SiteControl

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="module")]

TEXT = "cameras: [{id: c0, source: 'scene:room'}, {id: c1, source: 'scene:room'}]\n"
ZONE = "zones: [{id: till, camera: c0, area: [[0, 0], [9, 0], [9, 9]]}]\n"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "site.yaml"
    path.write_text(TEXT)
    return path


@asynccontextmanager
async def two_pages(browser: Browser, path: Path, section: str) -> AsyncIterator[tuple[Page, Page]]:
    """Open a section of a site with people in two browsers; saved zones are in force at once."""
    served: list[ServedSite] = []
    control = SiteControl(path, reload=lambda: apply_saved_zones(path, served[0]))
    async with AsyncExitStack() as stack:
        first = open_operator_page(browser, "#configuration", patience=PATIENCE, control=control)
        site, page = await stack.enter_async_context(first)
        served.append(site)
        show_people(site)
        other = await stack.enter_async_context(operator_page(browser, site.port, "#configuration"))
        for each in (page, other):
            await each.set_viewport_size({"width": 900, "height": 1400})
            await each.locator(f"#sections a[href='{section}']").click()
        yield page, other


async def rename(page: Page, camera: str, name: str) -> None:
    await page.get_by_label(f"Name of camera {camera}").fill(name)
    await page.get_by_role("button", name=f"Rename camera {camera}").click()


async def test_what_is_entered_for_the_site_stays_when_another_operator_has_changed_it(
    browser: Browser, path: Path
) -> None:
    async with two_pages(browser, path, "#cameras") as (page, other):
        for each in (page, other):
            await expect(each.get_by_label("Name of the site")).to_have_value("site")
        await other.get_by_label("Width").fill("320")
        await other.get_by_label("Frames a second").fill("10")
        await page.get_by_label("Name of the site").fill("mall")
        await page.get_by_label("Width").fill("960")
        await page.get_by_role("button", name="Change the site").click()
        await expect(page.locator("#site-state")).to_contain_text("Saved")
        await other.get_by_role("button", name="Change the site").click()
        await expect(other.locator("#site-state")).to_have_text(
            "Somebody else has changed the site meanwhile: name mall, width 960. "
            "What you entered is kept; press again to save it."
        )
        assert load_config(path).site.width == 960
        await expect(other.get_by_label("Name of the site")).to_have_value("mall")
        await other.get_by_role("button", name="Change the site").click()
        await expect(other.locator("#site-state")).to_contain_text("Saved")
        site = load_config(path).site
        assert (site.name, site.fps, site.width) == ("mall", 10, 320)


async def test_what_is_entered_for_the_site_stays_when_another_section_is_opened(
    browser: Browser, path: Path
) -> None:
    async with two_pages(browser, path, "#cameras") as (page, other):
        await expect(page.get_by_label("Width")).not_to_have_value("")
        await page.get_by_label("Width").fill("320")
        await page.locator("#sections").get_by_role("link", name="People").click()
        await other.get_by_label("Name of the site").fill("mall")
        await other.get_by_role("button", name="Change the site").click()
        await expect(other.locator("#site-state")).to_contain_text("Saved")
        await page.locator("#sections").get_by_role("link", name="Cameras").click()
        await expect(page.locator("#site-state")).to_contain_text("changed the site meanwhile: name mall.")
        await expect(page.get_by_label("Name of the site")).to_have_value("mall")
        await expect(page.get_by_label("Width")).to_have_value("320")


async def test_the_browser_asks_before_what_is_not_saved_is_lost(browser: Browser, path: Path) -> None:
    asked: list[str] = []

    async def stay(dialog: Dialog) -> None:
        asked.append(dialog.type)
        await dialog.dismiss()

    async with two_pages(browser, path, "#cameras") as (page, _):
        page.on("dialog", stay)
        await expect(page.get_by_label("Width")).not_to_have_value("")
        await page.get_by_label("Width").fill("320")
        async with page.expect_event("dialog"):
            await page.evaluate("location.reload()")
        await expect(page.get_by_label("Width")).to_have_value("320")
        await page.get_by_role("button", name="Change the site").click()
        await expect(page.locator("#site-state")).to_contain_text("Saved")
        await page.reload()
        await expect(page.get_by_label("Width")).to_have_value("320")
    assert asked == ["beforeunload"], "not after it was saved"


async def test_a_camera_that_another_operator_has_changed_is_not_changed_unseen(
    browser: Browser, path: Path
) -> None:
    async with two_pages(browser, path, "#cameras") as (page, other):
        for each in (page, other):
            await expect(each.get_by_label("Name of camera c0")).to_be_visible()
        await other.get_by_label("Name of camera c1").fill("stairs")
        await rename(page, "c0", "door")
        await expect(page.get_by_label("Name of camera door")).to_be_visible()
        await other.get_by_role("button", name="Remove camera c0").click()
        await expect(other.locator("#error-message")).to_have_text(
            "there is no camera 'c0': it was renamed or removed meanwhile"
        )
        await expect(other.get_by_label("Name of camera door")).to_be_visible()
        await expect(other.get_by_label("Name of camera c1")).to_have_value("stairs")
        path.write_text(path.read_text().replace("scene:room", "scene:court"))
        await other.get_by_role("button", name="Rename camera c1").click()
        await expect(other.locator("#error-message")).to_have_text(
            "camera c1 was changed in the configuration meanwhile: look, and try again"
        )
        await expect(other.locator("#site-cameras li").last).to_contain_text("scene:court")
        await other.get_by_role("button", name="Rename camera c1").click()
        await expect(other.get_by_label("Name of camera stairs")).to_be_visible()
        await expect(other.locator("#error-message")).to_be_empty()


async def corners(page: Page, *values: str) -> None:
    for name, value in zip(("Corner 3, x", "Corner 3, y"), values, strict=True):
        await page.get_by_label(name).fill(value)


async def test_a_zone_is_saved_although_another_operator_has_added_a_rule(
    browser: Browser, path: Path
) -> None:
    path.write_text(TEXT + ZONE)
    async with two_pages(browser, path, "#zones") as (page, other):
        await other.get_by_role("button", name="till, c0").click()
        await corners(other, "8", "7")
        await page.get_by_role("button", name="Rules anywhere").click()
        await page.get_by_role("button", name="Add a rule").click()
        await page.get_by_role("button", name="Save").click()
        await expect(page.locator("#zone-state")).to_contain_text("Saved, and in force")
        await other.get_by_role("button", name="Save").click()
        await expect(other.locator("#zone-state")).to_contain_text("Saved, and in force")
        config = load_config(path)
        assert [list(corner) for corner in config.zones[0].area or ()][2] == [8, 7]
        assert len(config.rules) == 1


@pytest.mark.parametrize("is_removed", [False, True])
async def test_a_drawn_zone_stays_when_another_operator_has_changed_it(
    browser: Browser, path: Path, *, is_removed: bool
) -> None:
    path.write_text(TEXT + ZONE)
    async with two_pages(browser, path, "#zones") as (page, other):
        for each in (page, other):
            await each.get_by_role("button", name="till, c0").click()
        await corners(other, "8", "7")
        if is_removed:
            await page.locator("#zone-remove").click()
        else:
            await corners(page, "5", "6")
            await page.get_by_role("button", name="Save").click()
        await expect(page.locator("#zone-state")).to_contain_text("Saved, and in force")
        await other.get_by_role("button", name="Save").click()
        what = "removed" if is_removed else "changed"
        await expect(other.locator("#zone-state")).to_have_text(
            f"Somebody else has {what} zone till meanwhile. What is entered here is kept: "
            "save it, or cancel to see theirs."
        )
        theirs = [] if is_removed else [(5, 6)]
        assert [tuple((zone.area or ())[2]) for zone in load_config(path).zones] == theirs
        await expect(other.locator("#zone-remove")).to_be_visible(visible=not is_removed)
        await expect(other.get_by_label("Corner 3, x")).to_have_value("8")
        await other.get_by_role("button", name="Save").click()
        await expect(other.locator("#zone-state")).to_contain_text("Saved, and in force")
        assert [tuple((zone.area or ())[2]) for zone in load_config(path).zones] == [(8, 7)]
