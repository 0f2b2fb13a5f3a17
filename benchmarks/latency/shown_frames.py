"""The page in Chromium, and the time when it showed each frame."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

from playwright.async_api import Browser

from benchmarks.common.process_load import read_processor_usage

_PLAYING_MS = 60_000
_READ_EVERY_S = 10.0
"""The page remembers some 80 seconds of frames."""


@dataclass(frozen=True, slots=True)
class ShownFrames:
    """The frames that the page showed during the measurement."""

    object: int
    at: dict[int, float]
    """By pulse: when it was first shown, unix seconds."""
    lookahead: int
    """The look-ahead that the site declares, frames."""
    fps: float
    cores: dict[str, float]
    """Cores in use, by process name."""


async def watch_page(browser: Browser, url: str, settle_s: float, seconds: float) -> ShownFrames:
    """Open the page, let it settle, then record the shown frames for some seconds."""
    # The page's policy forbids eval, which Playwright needs.
    page = await browser.new_page(viewport={"width": 1280, "height": 800}, bypass_csp=True)
    try:
        await page.goto(url)
        await page.wait_for_function(
            "myview.state === 'playing' && myview.delays.length > 0", timeout=_PLAYING_MS
        )
        await asyncio.sleep(settle_s)
        begin, before = await page.evaluate("Date.now()"), read_processor_usage()
        at: dict[int, float] = {}
        left = seconds
        while left > 0:
            await asyncio.sleep(min(left, _READ_EVERY_S))
            left -= _READ_EVERY_S
            for shown in await page.evaluate("myview.delays"):
                if shown["shownAt"] >= begin:
                    at.setdefault(shown["pulse"], shown["shownAt"] / 1e3)
        cores = read_processor_usage().cores_since(before)
        site = await page.evaluate("myview.site")
        number = await page.evaluate("myview.object")
        return ShownFrames(
            int(number), at, round(site["lookahead_s"] * site["fps"]), float(site["fps"]), cores
        )
    finally:
        await page.close()
