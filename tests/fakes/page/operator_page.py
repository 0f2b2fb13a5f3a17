"""The operator's page of a served site in a browser, and what every part of it must keep."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager
from typing import Any

from playwright.async_api import Browser, Page

from fakes.page.browser import new_page
from fakes.service.fed_site import ServedSite, serve_site

PLAN = [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 1.0]]
"""Of a camera that looks straight down: ten pixels are one unit of the floor."""


@asynccontextmanager
async def open_operator_page(
    browser: Browser, place: str = "", axe: str = "", *, patience: float = 60, **changes: Any
) -> AsyncIterator[tuple[ServedSite, Page]]:
    """Open the operator's page of a site; an exception or a refused resource in the page fails the test."""
    async with aclosing(serve_site(patience=patience, **changes)) as sites:
        served = await anext(sites)
        async with operator_page(browser, served.port, place, axe) as page:
            yield served, page


@asynccontextmanager
async def operator_page(browser: Browser, port: int, place: str = "", axe: str = "") -> AsyncIterator[Page]:
    """Open the operator's page on a port; an exception or a refused resource in the page fails the test."""
    complaints: list[str] = []
    page = await new_page(browser, viewport={"width": 1000, "height": 800})
    await page.add_init_script(axe)  # without the site's content policy
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on(
        "console",
        lambda message: complaints.append(message.text) if "Content Security" in message.text else None,
    )
    await page.goto(f"http://127.0.0.1:{port}/operator{place}")
    yield page
    await page.close()
    assert complaints == []


async def press_picture(page: Page, point: tuple[float, float], size: tuple[int, int]) -> None:
    """Mark a point, in pixels, in the picture of the given size in which places of the floor are marked."""
    box = await page.locator("#points-stage").bounding_box()
    assert box is not None
    x, y = point[0] / size[0] * box["width"], point[1] / size[1] * box["height"]
    await page.locator("#points-stage").click(position={"x": x, "y": y})


async def check_button_sizes(page: Page) -> None:
    for button in await page.locator("button:visible, select:visible, nav a").all():
        box = await button.bounding_box()
        assert box is not None
        assert min(box["width"], box["height"]) >= 44, await button.text_content()


async def serious_faults(page: Page) -> list[Any]:
    found = await page.evaluate("axe.run()")
    return [
        (violation["id"], [node["html"] for node in violation["nodes"]])
        for violation in found["violations"]
        if violation["impact"] in {"serious", "critical"}
    ]
