"""From nothing to a watched site of three cameras, in a browser: found by ONVIF, tried over RTSP, started."""

from __future__ import annotations

import re
import stat
from pathlib import Path

import pytest
from playwright.async_api import expect

from benchmarks.common.browser import chromium
from fakes.page.accessibility import page_violations
from fakes.page.browser import new_page
from fakes.paths import AXE
from fakes.programs import needs_chromium
from fakes.setup.room_cameras import LOGIN, NAMES, room_cameras
from fakes.setup.setup_run import add_found_cameras, set_up, write_and_watch
from server.config.loader import load_config

pytestmark = [needs_chromium, pytest.mark.live]


async def test_a_site_of_three_cameras_is_set_up_watched_and_its_passwords_stay_secret(
    tmp_path: Path,
) -> None:
    pytest.importorskip("onvif", reason="needs onvif-zeep-async: the extra onvif")
    with room_cameras() as discovery:
        async with set_up(tmp_path, discovery) as run, chromium() as browser:
            page = await new_page(browser, bypass_csp=True)
            await add_found_cameras(page, run.url)
            await page.get_by_label(re.compile("Name of the camera")).first.fill("front")
            await page.keyboard.press("Tab")
            await expect(page.get_by_alt_text("Picture of front")).to_be_visible()
            if AXE.exists():
                assert await page_violations(page) == []
            assert LOGIN[1] not in await page.content()
            await write_and_watch(page, "hall")
            await page.close()
        config = load_config(tmp_path / "site.yaml")
        assert config.camera_ids == ("front", *NAMES[1:])
        assert [camera.substream is not None for camera in config.cameras] == [True, False, False]
        assert (config.site.name, config.site.size, config.site.fps) == ("hall", (320, 180), 10.0)
        assert stat.S_IMODE((tmp_path / "site.passwords" / "front").stat().st_mode) == 0o600
        for text in (*run.lines, (tmp_path / "site.yaml").read_text()):
            assert LOGIN[1] not in text
            assert "p%40ss" not in text
