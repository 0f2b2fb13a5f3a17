"""The operator's page in a browser, on a served site: it signs in, and what it does the site does."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager
from typing import Any

import pytest
import pytest_asyncio
from halls import Hall, opened
from playwright.async_api import Browser, Page, expect

from benchmarks.browser import CHROMIUM, chromium
from server.web.operator_permission import digest_of

TOKEN = "a token of theirs"  # noqa: S105 — of a test

pytestmark = [
    pytest.mark.skipif(not CHROMIUM.exists(), reason=f"needs a Chromium at {CHROMIUM}"),
    pytest.mark.asyncio(loop_scope="module"),
]


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def browser() -> AsyncIterator[Browser]:
    async with chromium() as running:
        yield running


@asynccontextmanager
async def operating(
    browser: Browser, place: str = "", width: int = 1000, **changes: Any
) -> AsyncIterator[tuple[Hall, Page]]:
    """Open the operator's page of a site; an exception or a refused resource in the page fails the test."""
    complaints: list[str] = []
    async with aclosing(opened(patience=60, **changes)) as halls:
        hall = await anext(halls)
        page = await browser.new_page(viewport={"width": width, "height": 800})
        page.set_default_timeout(15_000)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "console",
            lambda it: complaints.append(it.text) if "Content Security" in it.text else None,
        )
        await page.goto(f"http://127.0.0.1:{hall.port}/operator{place}")
        yield hall, page
        await page.close()
    assert complaints == []


async def test_who_has_the_token_signs_in_and_out(browser: Browser) -> None:
    async with operating(browser, http={"operator_token": digest_of(TOKEN)}) as (_, page):
        field = page.get_by_label("The operator's token")
        await field.fill("wrong")
        await page.get_by_role("button", name="Sign in").click()
        await expect(page.locator("#trouble")).to_have_text("that is not the operator's token")
        await page.keyboard.type(TOKEN)  # the field has the focus, and what was wrong is marked
        await page.keyboard.press("Enter")
        await expect(field).to_be_hidden()
        await expect(page.locator("#trouble")).to_be_empty()
        assert await page.evaluate("document.cookie") == ""
        await page.reload()
        await page.get_by_role("button", name="Sign out").click()
        await expect(field).to_be_visible()


async def test_without_a_token_there_is_nothing_to_sign_in_to(browser: Browser) -> None:
    async with operating(browser) as (hall, page):
        await expect(page.locator("#site")).to_have_text(hall.service.config.site.name)
        await expect(page.get_by_label("The operator's token")).to_be_hidden()
        await expect(page.get_by_role("button", name="Sign out")).to_be_hidden()
