"""`myview up` in an empty folder, whose page sets up a site of the cameras that it finds."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path

from playwright.async_api import Page, expect

from fakes.running.site import MYVIEW
from fakes.setup.room_cameras import LOGIN, NAMES
from fakes.timeouts import PATIENCE, PATIENCE_MS
from server.cli.generated_config import free_port

PATIENT_SITE = {
    "MYVIEW_SITE__NICENESS": "1",
    "MYVIEW_TRACK__BACKLOG_S": "60",
    "MYVIEW_VIEW__LATE_AFTER_S": "10",
    "MYVIEW_DETECT__WORK_WIDTH": "192",
    "MYVIEW_DETECT__BOX_FILTER__HEIGHT_STEP": "1.16",
}
"""Settings from the environment with which a busy machine still finds people."""


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
async def set_up(folder: Path, discovery: str) -> AsyncIterator[SetupRun]:
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


async def add_found_cameras(page: Page, url: str) -> None:
    """Find the cameras, sign in to them, and try each, until the picture of each is shown."""
    await page.goto(url)
    await expect(page.locator("#found li")).to_have_count(len(NAMES))
    await page.get_by_label("Their user").fill(LOGIN[0])
    await page.get_by_label("and password").fill(LOGIN[1])
    for button in await page.get_by_role("button", name=re.compile("Show its streams")).all():
        await button.click()
    for name in NAMES:
        await add_camera(page, name)
    await page.wait_for_function("[...document.querySelectorAll('#added img')].every((i) => i.naturalWidth)")


async def write_and_watch(page: Page, site: str) -> None:
    """Name the site, start it, follow the link to its page, and wait until a person is watched."""
    await page.get_by_label("Name of the site").fill(site)
    await page.get_by_role("button", name="Write the configuration and start").click()
    await page.get_by_role("link", name="Watch").click(timeout=PATIENCE_MS)
    await page.wait_for_function(WATCHED, timeout=PATIENCE_MS, polling=2000)
