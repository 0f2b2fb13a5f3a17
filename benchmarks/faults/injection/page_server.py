"""The page while its server dies: when it is back."""

from __future__ import annotations

import asyncio
import signal
import time

from benchmarks.common.browser import chromium, chromium_path
from benchmarks.common.demo_site import open_when_there
from benchmarks.faults.site.fault_site import Fault, FaultSite, with_up

_PLAYING_MS = 90_000
_POLL_S = 0.05
_PATIENCE_S = 60.0
_END = """() => {
  const { buffered } = document.querySelector('video');
  return buffered.length ? buffered.end(buffered.length - 1) : 0;
}"""


async def killed(stand: FaultSite) -> None:
    """Kill the best view while a browser shows the page; note when more video than before has come.

    Raises:
        RuntimeError: there is no browser, or the page does not come back.
    """
    if chromium_path() is None:
        raise RuntimeError("there is no browser: it needs Chromium")
    async with chromium() as browser:
        page = await browser.new_page(bypass_csp=True)  # the page's policy forbids eval, which asks it here
        await open_when_there(page, f"{stand.url}?object={stand.viewers[0].number}")
        await page.wait_for_function("myview.state === 'playing'", timeout=_PLAYING_MS)
        stand.returned.clear()  # a browser that starts may have kept a busy machine from being ready
        stand.send(signal.SIGKILL, "bestview")
        await asyncio.sleep(_POLL_S)
        before = await page.evaluate(_END)
        give_up = time.monotonic() + _PATIENCE_S
        while await page.evaluate(_END) <= before:
            if time.monotonic() > give_up:
                raise RuntimeError("the page did not come back")
            await asyncio.sleep(_POLL_S)
        stand.page_at = time.monotonic()


FAULTS = (Fault("kill bestview, page", with_up, killed, 15.0, None, breaks=True),)
