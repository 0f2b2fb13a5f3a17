"""Debian's Chromium without a screen."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import AsyncIterator
from pathlib import Path

from playwright.async_api import Browser, async_playwright

from benchmarks.common.environment import CannotRunError

FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


def chromium_path() -> Path | None:
    """Return where the browser is, as Debian or another system names it; None: nowhere on the PATH."""
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)
    return None if found is None else Path(found)


def check_chromium() -> None:
    """Make sure that there is a browser.

    Raises:
        CannotRunError: there is none.
    """
    if chromium_path() is None:
        raise CannotRunError("needs Chromium; on Debian: apt install chromium")


@contextlib.asynccontextmanager
async def chromium() -> AsyncIterator[Browser]:
    """Run a browser."""
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=chromium_path(), args=FLAGS)
        try:
            yield browser
        finally:
            await browser.close()
