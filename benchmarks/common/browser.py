"""Headless Chromium."""

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


_PROGRAMS = ("chromium-headless-shell", "chromium", "chromium-browser")
"""The shell first: without a desktop browser's windows and menus a page takes half of the processor time."""


def chromium_path() -> Path | None:
    """Return the path of Chromium; None: it is not on the PATH."""
    program = next(filter(None, map(shutil.which, _PROGRAMS)), None)
    return None if program is None else Path(program)


def check_chromium() -> None:
    """Check that Chromium is installed.

    Raises:
        CannotRunError: it is not.
    """
    if chromium_path() is None:
        raise CannotRunError("needs Chromium; on Debian: apt install chromium")


@contextlib.asynccontextmanager
async def chromium() -> AsyncIterator[Browser]:
    """Run headless Chromium."""
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=chromium_path(), args=FLAGS)
        try:
            yield browser
        finally:
            await browser.close()
