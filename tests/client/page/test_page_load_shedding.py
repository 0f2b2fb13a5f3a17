"""The viewer's page shows which cameras shed load."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import visiting
from fakes.page.site import FakeSite
from fakes.page.video_pattern import CAMERAS
from fakes.programs import needs_chromium
from server.camera.load.load_shedder import shed_levels

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]


async def test_the_shed_level_of_a_camera_is_shown_beside_its_name(browser: Browser) -> None:
    levels = shed_levels(5, live=True)
    site = FakeSite(busy={CAMERAS[1]: levels[1].description, CAMERAS[2]: levels[-1].description})
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        items = visit.page.locator("#cameras li")
        await expect(items.nth(0)).not_to_contain_text("searching")
        await expect(items.nth(1)).to_contain_text("detecting in every 2nd frame")
        await expect(items.nth(2)).to_contain_text("showing every 4th and detecting in every 5th frame")
        for busy in (1, 2):
            await expect(items.nth(busy)).to_have_attribute(
                "title", levels[-1 if busy == 2 else 1].description
            )
            await expect(items.nth(busy)).not_to_have_class("away")
