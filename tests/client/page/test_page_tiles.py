"""Tiles: other people in small players beneath the large one."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import Visit, visiting
from fakes.page.site import FakeSite
from fakes.page.video_pattern import FPS
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]

FIVE = {1: True, 2: True, 3: True, 4: True, 5: True}


async def wait_for_playing_tiles(visit: Visit, count: int) -> None:
    """Wait until `count` tiles exist and play as fast as the large player."""
    tiles = "[...document.querySelectorAll('#tiles video')]"
    await visit.until(
        f"{tiles}.length === {count} && {tiles}.every((tile) => tile.currentTime > 0 && !tile.paused)"
    )
    times = await visit.get(f"{tiles}.map((tile) => tile.currentTime)")
    pulse = await visit.get("myview.pulse")
    await visit.until(f"myview.pulse > {pulse + 2 * FPS}")
    await visit.until(f"{tiles}.every((tile, n) => tile.currentTime > {times}[n] + 1)")


async def test_a_person_is_added_as_a_tile_and_swapped_by_a_press(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.get_by_role("button", name="Person 2 beside").click()
        await wait_for_playing_tiles(visit, 1)
        assert visit.page.url.endswith("?object=1&beside=2")
        await visit.page.get_by_role("button", name="Person 2: make large").click()
        await visit.playing(2)
        assert visit.page.url.endswith("?object=2&beside=1")
        await expect(visit.page.get_by_role("button", name="Person 1: make large")).to_be_focused()
        await wait_for_playing_tiles(visit, 1)
        await visit.page.get_by_role("button", name="Person 1 beside").click()
        await expect(visit.page.locator("#tiles")).to_be_hidden()
        assert visit.page.url.endswith("?object=2")


@pytest.mark.slow
async def test_there_are_at_most_three_tiles_also_by_link(browser: Browser) -> None:
    async with visiting(browser, FakeSite(people=FIVE), "?object=1&beside=2,3,4,9") as visit:
        await visit.playing(1)
        await wait_for_playing_tiles(visit, 3)
        await visit.page.get_by_role("button", name="Person 3: make large").click()
        await expect(visit.page.locator(".tile")).to_have_text(["2", "1", "4"])
        await visit.page.get_by_role("button", name="Person 5 beside").click()
        await expect(visit.page.get_by_role("button", name="make large")).to_have_count(3)
        await expect(visit.page.get_by_role("button", name="Person 5: make large")).to_be_visible()
        await wait_for_playing_tiles(visit, 3)


@pytest.mark.slow
async def test_boxes_are_switched_on_tiles_too(browser: Browser) -> None:
    painted = """[...document.querySelectorAll('#tiles canvas')].every((canvas) => canvas.width > 0
        && canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height)
          .data.some((value) => value > 0))"""
    async with visiting(browser, query="?object=1&beside=2") as visit:
        await visit.playing(1)
        await wait_for_playing_tiles(visit, 1)
        await visit.until(painted)
        await visit.page.keyboard.press("b")
        await visit.until(f"!({painted})")
