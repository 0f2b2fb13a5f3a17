"""From nothing to a watched, calibrated site of three cameras, all in a browser."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from playwright.async_api import Page, expect

from benchmarks.common.browser import chromium
from bestview.geometry.ground_plane import from_ground, to_ground
from fakes.page.browser import new_page
from fakes.page.operator_page import press_picture
from fakes.programs import needs_chromium
from fakes.setup.room_cameras import MAIN, NAMES, room, room_cameras
from fakes.setup.setup_run import WATCHED, add_found_cameras, set_up, write_and_watch
from fakes.timeouts import PATIENCE_MS
from server.config.loader import load_config

pytestmark = [needs_chromium, pytest.mark.live, pytest.mark.slow]

PLACES = ((3.0, 4.0), (7.0, 3.0), (4.0, 6.0), (8.0, 6.0), (5.0, 2.0), (6.0, 5.0))
"""On the floor of the room, in meters; all cameras see them."""


async def mark_places(page: Page) -> None:
    """Mark each place in each camera's picture, and enter where it is."""
    for number, name in enumerate(NAMES):
        matrix = room().homography(number)
        assert matrix is not None
        await page.locator("#points-camera").select_option(name)
        picture = await page.locator("#points-image").element_handle()
        await page.wait_for_function("(it) => it.naturalWidth > 0", arg=picture)
        if number:
            await page.get_by_label("Place to press").select_option("0")
        for place, (x, y) in enumerate(PLACES, 1):
            ((image_x, image_y),) = from_ground(matrix, np.array([(x, y)])).tolist()
            await press_picture(page, (image_x, image_y), MAIN)
            if not number:
                await page.get_by_label(f"Place {place}, x on the floor").fill(f"{x:g}")
                await page.get_by_label(f"Place {place}, y on the floor").fill(f"{y:g}")


async def test_three_found_cameras_become_a_calibrated_site_whose_floor_shows_people(tmp_path: Path) -> None:
    pytest.importorskip("onvif", reason="needs onvif-zeep-async: the extra onvif")
    with room_cameras() as discovery:
        async with set_up(tmp_path, discovery) as run, chromium() as browser:
            page, site = await new_page(browser, bypass_csp=True), run.url.partition("#")[0]
            await add_found_cameras(page, run.url)
            await write_and_watch(page, "hall")
            await page.goto(f"{site}operator#calibration-points")
            await mark_places(page)
            await page.get_by_role("button", name="Calibrate", exact=True).click()
            await expect(page.locator("#points-lines li")).to_have_count(len(NAMES))
            await page.get_by_role("button", name="Write into the configuration").click()
            await expect(page.locator("#points-state")).to_contain_text("Written into the configuration")
            await page.get_by_role("button", name="Restart the site").click()
            await expect(page.locator("#restart-state")).to_contain_text("The site restarts")
            await page.goto(f"{site}operator#floor")
            await expect(page.locator("#plan polygon")).to_have_count(len(NAMES), timeout=PATIENCE_MS)
            await expect(page.locator("#positions li").first).to_contain_text("seen by", timeout=PATIENCE_MS)
            await page.goto(site)
            await page.wait_for_function(WATCHED, timeout=PATIENCE_MS, polling=2000)
            await page.close()
    for number, camera in enumerate(load_config(tmp_path / "site.yaml").cameras):
        true = room().homography(number)
        assert true is not None
        assert camera.ground is not None
        seen = from_ground(true, np.array(PLACES))
        off = to_ground(np.array(camera.ground, dtype=np.float64), seen) - np.array(PLACES)
        assert np.hypot(*off.T).max() < 0.2, "meters; the page marks whole pixels of the screen"
