"""Recovery of the page after its server is killed."""

from __future__ import annotations

import asyncio
import signal
import time

from benchmarks.common.browser import chromium, chromium_path
from benchmarks.common.demo_site import open_when_ready
from benchmarks.faults.site.fault_site import Fault, FaultSite, with_up

_PLAYING_MS = 90_000
_POLL_S = 0.05
_TIMEOUT_S = 60.0
_END = """() => {
  const { buffered } = document.querySelector('video');
  return buffered.length ? buffered.end(buffered.length - 1) : 0;
}"""


async def kill_server_behind_page(fault_site: FaultSite) -> None:
    """Kill the best view while a browser shows the page; record when new video arrives.

    Raises:
        RuntimeError: there is no browser, or the page does not recover.
    """
    if chromium_path() is None:
        raise RuntimeError("Chromium is missing")
    async with chromium() as browser:
        page = await browser.new_page(
            bypass_csp=True
        )  # the page's policy forbids eval, which this check uses
        await open_when_ready(page, f"{fault_site.url}?object={fault_site.viewers[0].number}")
        await page.wait_for_function("myview.state === 'playing'", timeout=_PLAYING_MS)
        fault_site.ready_times.clear()  # the browser's start may have slowed the server down
        fault_site.send(signal.SIGKILL, "bestview")
        await asyncio.sleep(_POLL_S)
        before = await page.evaluate(_END)
        deadline = time.monotonic() + _TIMEOUT_S
        while await page.evaluate(_END) <= before:
            if time.monotonic() > deadline:
                raise RuntimeError("the page did not recover")
            await asyncio.sleep(_POLL_S)
        fault_site.page_resumed_at = time.monotonic()


FAULTS = (Fault("kill bestview, page", with_up, kill_server_behind_page, 15.0, None, kills_server=True),)
