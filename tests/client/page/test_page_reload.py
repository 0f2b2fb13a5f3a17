"""Pages whose files could not be loaded, or whose first requests fail, become complete by themselves."""

from __future__ import annotations

import re
from contextlib import aclosing
from importlib.resources import files
from pathlib import Path

import pytest
from playwright.async_api import Browser, Page, Route, expect

from fakes.http.tokens import serve_with_tokens, token_of
from fakes.page.browser import new_page
from fakes.programs import needs_chromium
from fakes.service.fed_site import serve_site

PAGES = Path(str(files("client") / "page"))

pytestmark = pytest.mark.asyncio(loop_scope="session")


async def fail_once(page: Page, path: str, method: str) -> list[str]:
    """Let the first request of a path fail; return the list in which it will be."""
    failed: list[str] = []

    async def handle(route: Route) -> None:
        if failed or route.request.method != method:
            await route.continue_()
        else:
            failed.append(route.request.url)
            await route.abort("internetdisconnected")

    await page.route(f"**/{path}", handle)
    return failed


@needs_chromium
@pytest.mark.parametrize(
    ("address", "failing"),
    [
        ("", "page/main.js"),
        ("", "page/people/names.js"),
        ("operator", "page/style.css"),
        ("operator", "page/operator/section.js"),
        ("operator", "page/operator/calibration/walk.js"),
        ("operator", "api/session"),
        ("operator", "api/site"),
    ],
)
async def test_a_page_is_complete_although_a_request_failed(
    browser: Browser, address: str, failing: str
) -> None:
    """As all requests fail while a browser changes from one network to another."""
    async with aclosing(serve_site()) as sites:
        page = await new_page(browser)
        failed = await fail_once(page, failing, "GET")
        await page.goto(f"http://127.0.0.1:{(await anext(sites)).port}/{address}")
        await expect(page.locator("#site")).not_to_be_empty()
        await page.wait_for_function(
            "document.styleSheets.length > 0 && document.styleSheets[0].cssRules.length > 9"
        )
        await page.close()
    assert failed


@needs_chromium
async def test_a_link_with_a_token_signs_in_although_the_first_request_failed(
    browser: Browser, tmp_path: Path
) -> None:
    async with serve_with_tokens(tmp_path) as served:
        page = await new_page(browser)
        failed = await fail_once(page, "api/session", "POST")
        await page.goto(f"http://127.0.0.1:{served.port}/operator#token={token_of('lead')}")
        await expect(page.locator("#cameras")).to_be_visible()
        await page.close()
    assert failed


@pytest.mark.parametrize("page", sorted(PAGES.glob("*.html")), ids=lambda path: path.stem)
async def test_every_page_can_reload_before_it_needs_a_file(page: Path) -> None:
    first, *others = re.findall(
        r'<(?:script|link rel="stylesheet") .*?(?:src|href)="([^"]+)"', page.read_text()
    )
    assert first == "page/shared/reload.js"
    assert len(others) >= 2
