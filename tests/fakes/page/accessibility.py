"""Accessibility violations of a page, by axe-core."""

from __future__ import annotations

from typing import Any

from playwright.async_api import Page

from fakes.page.browser import Visit
from fakes.paths import AXE

SERIOUS = ("serious", "critical")


async def violations(visit: Visit) -> list[Any]:
    """Return the serious violations of a visited page: rule, help and elements."""
    return await page_violations(visit.page)


async def page_violations(page: Page) -> list[Any]:
    """Return the serious violations of a page: rule, help and elements."""
    await page.add_script_tag(path=AXE)
    found = await page.evaluate("axe.run()")
    return [
        (violation["id"], violation["help"], [node["html"] for node in violation["nodes"]])
        for violation in found["violations"]
        if violation["impact"] in SERIOUS
    ]
