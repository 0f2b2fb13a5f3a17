"""The viewer's page shows which cameras shed load, and which are lost."""

from __future__ import annotations

import re

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


async def test_a_lost_camera_says_why_and_when_it_is_opened_again(browser: Browser) -> None:
    site = FakeSite(lost={CAMERAS[2]: "its source delivers no frames: Connection refused"})
    async with visiting(browser, site) as visit:
        item = visit.page.locator("#cameras li").nth(2)
        await expect(item).to_contain_text("gone")
        line = r"Will be opened again at \d.*: its source delivers no frames: Connection refused$"
        await expect(item).to_have_attribute("title", re.compile(line))
