"""From nothing to a watched site of three cameras, in a browser: found by ONVIF, tried over RTSP, started."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import stat
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from benchmarks.common.browser import chromium
from fakes.page.accessibility import page_violations
from fakes.page.browser import new_page
from fakes.paths import AXE
from fakes.programs import needs_chromium
from fakes.running.site import MYVIEW
from fakes.setup.room_cameras import LOGIN, NAMES, room_cameras
from fakes.timeouts import PATIENCE, PATIENCE_MS
from server.cli.generated_config import free_port
from server.config.loader import load_config

PATIENT_SITE = {
    "MYVIEW_SITE__NICENESS": "1",
    "MYVIEW_TRACK__BACKLOG_S": "60",
    "MYVIEW_VIEW__LATE_AFTER_S": "10",
    "MYVIEW_DETECT__WORK_WIDTH": "192",
    "MYVIEW_DETECT__BOX_FILTER__HEIGHT_STEP": "1.16",
}
"""Settings from the environment with which a busy machine still finds people."""

pytestmark = [needs_chromium, pytest.mark.live]


WATCHED = """() => {
  const { state } = globalThis.myview ?? {};
  if (state === 'away') document.querySelector('.person:not(.away, [aria-current=true])')?.click();
  return state === 'playing';
}"""
"""Whether a person is watched; people leave every ten seconds, and then another is chosen."""


@dataclass(slots=True)
class SetupRun:
    """`myview up` in an empty folder, and its output."""

    folder: Path
    url: str = ""
    lines: list[str] = field(default_factory=list)


@contextlib.asynccontextmanager
async def up(folder: Path, discovery: str) -> AsyncIterator[SetupRun]:
    """Run `myview up` without a configuration; yield when it has printed the address of the page."""
    bus = f"tcp/127.0.0.1:{free_port()}"
    environment = {
        **os.environ,
        "PYTHONUNBUFFERED": "1",
        "PYTHONPATH": str(Path.cwd()),
        "MYVIEW_DISCOVERY": discovery,
        "MYVIEW_SYNC__PORT": str(free_port()),
        "MYVIEW_ZENOH__CONNECT": bus,
        "MYVIEW_ZENOH__LISTEN": bus,
        **PATIENT_SITE,
    }
    process = await asyncio.create_subprocess_exec(
        *(*MYVIEW, "up", "--port", "0"),
        cwd=folder,
        env=environment,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    run = SetupRun(folder)
    printed = asyncio.Event()

    async def read() -> None:
        assert process.stdout is not None
        async for line in process.stdout:
            run.lines.append(line.decode().rstrip())
            if (address := re.search(r"http://127\.0\.0\.1:\d+/#token=\S+", run.lines[-1])) is not None:
                run.url = address[0]
                printed.set()

    reading = asyncio.create_task(read())
    try:
        async with asyncio.timeout(PATIENCE):
            await printed.wait()
        yield run
    finally:
        if process.returncode is None:
            process.terminate()
        await asyncio.wait_for(process.wait(), PATIENCE)
        await reading


async def add_camera(page: Page, name: str) -> None:
    """Try the main stream of a found camera."""
    item = page.locator("#found li", has_text=name)
    if name == NAMES[0]:
        sub = item.locator("option", has_text="sub")
        await item.get_by_label("in which people are tracked").select_option(await sub.get_attribute("value"))
    await item.get_by_role("button", name=re.compile("Try main")).click()
    await expect(page.get_by_label(re.compile("Name of the camera")).last).to_have_value(name)


async def test_a_site_of_three_cameras_is_set_up_watched_and_its_passwords_stay_secret(
    tmp_path: Path,
) -> None:
    pytest.importorskip("onvif", reason="needs onvif-zeep-async: the extra onvif")
    with room_cameras() as discovery:
        async with up(tmp_path, discovery) as run, chromium() as browser:
            page = await new_page(browser, bypass_csp=True)
            await page.goto(run.url)
            await expect(page.locator("#found li")).to_have_count(len(NAMES))
            await page.get_by_label("Their user").fill(LOGIN[0])
            await page.get_by_label("and password").fill(LOGIN[1])
            for button in await page.get_by_role("button", name=re.compile("Show its streams")).all():
                await button.click()
            for name in NAMES:
                await add_camera(page, name)
            await page.wait_for_function(
                "[...document.querySelectorAll('#added img')].every((i) => i.naturalWidth)"
            )
            await page.get_by_label(re.compile("Name of the camera")).first.fill("front")
            await page.keyboard.press("Tab")
            await expect(page.get_by_alt_text("Picture of front")).to_be_visible()
            if AXE.exists():
                assert await page_violations(page) == []
            assert LOGIN[1] not in await page.content()
            await page.get_by_label("Name of the site").fill("hall")
            await page.get_by_role("button", name="Write the configuration and start").click()
            await page.get_by_role("link", name="Watch").click(timeout=PATIENCE_MS)
            await page.wait_for_function(WATCHED, timeout=PATIENCE_MS, polling=2000)
            await page.close()
        config = load_config(tmp_path / "site.yaml")
        assert config.camera_ids == ("front", *NAMES[1:])
        assert [camera.substream is not None for camera in config.cameras] == [True, False, False]
        assert (config.site.name, config.site.size, config.site.fps) == ("hall", (320, 180), 10.0)
        assert stat.S_IMODE((tmp_path / "site.passwords" / "front").stat().st_mode) == 0o600
        for text in (*run.lines, (tmp_path / "site.yaml").read_text()):
            assert LOGIN[1] not in text
            assert "p%40ss" not in text
