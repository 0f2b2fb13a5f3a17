"""Signing in on the viewer's page, in a browser: the page shows what the token permits."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from playwright.async_api import Browser, Page, expect

from fakes.http.tokens import serve_with_tokens, token_entry, token_of, write_tokens
from fakes.page.browser import new_page
from fakes.paths import AXE
from fakes.programs import needs_chromium
from fakes.service.fed_site import ServedSite, show_people

pytestmark = [
    needs_chromium,
    pytest.mark.asyncio(loop_scope="module"),
]


@asynccontextmanager
async def open_page(
    browser: Browser, folder: Path, address: str = ""
) -> AsyncIterator[tuple[ServedSite, Page, list[str]]]:
    """Open the page of a site with tokens and two people; also yield the requests that it received."""
    async with serve_with_tokens(folder) as served:
        show_people(served)
        page = await new_page(browser, viewport={"width": 1000, "height": 800})
        await page.add_init_script(AXE.read_text(encoding="utf-8") if AXE.exists() else "")
        complaints: list[str] = []
        addresses: list[str] = []
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: addresses.append(request.url))
        await page.goto(f"http://127.0.0.1:{served.port}/{address}")
        yield served, page, addresses
        await page.close()
        assert complaints == []


async def test_a_viewer_watches_from_signing_in_to_signing_out(browser: Browser, tmp_path: Path) -> None:
    async with open_page(browser, tmp_path) as (_, page, _):
        field = page.get_by_label("Watching needs a token")
        await field.fill("wrong")
        await page.get_by_role("button", name="Sign in").click()
        await expect(page.locator("#sign-in-error")).to_have_text("unknown or revoked token")
        await expect(page.locator("#stage")).to_be_hidden()
        await field.fill(token_of("desk"))
        await page.keyboard.press("Enter")
        await expect(page.locator("#people li")).to_have_count(2)
        await expect(field).to_be_hidden()
        assert await page.evaluate("document.cookie") == ""
        await page.locator("#more summary").click()
        await page.get_by_role("button", name="Sign out").click()
        await expect(field).to_be_visible()
        await expect(page.locator("#people li")).to_have_count(0)


async def test_a_link_with_a_token_opens_a_person_and_drops_the_token_from_the_url(
    browser: Browser, tmp_path: Path
) -> None:
    token = token_of("family")
    async with open_page(browser, tmp_path, f"?object=1#token={token}") as (_, page, addresses):
        await expect(page.locator("#people li")).to_have_count(1)
        await expect(page.get_by_label("Watching needs a token")).to_be_hidden()
        assert "token" not in await page.evaluate("location.href")
        requested = [address for address in addresses if "#" not in address]
        assert any("best.mp4" in address for address in requested)
        assert not any(token in address for address in requested)


async def test_a_viewer_whose_token_is_revoked_is_shown_the_sign_in_form(
    browser: Browser, tmp_path: Path
) -> None:
    async with open_page(browser, tmp_path) as (_, page, _):
        field = page.get_by_label("Watching needs a token")
        await field.fill(token_of("desk"))
        await page.keyboard.press("Enter")
        await expect(page.locator("#people li")).to_have_count(2)
        write_tokens(tmp_path / "tokens.yaml", token_entry("lead"))
        await expect(field).to_be_visible()


async def test_axe_finds_no_violation_in_the_sign_in_form(browser: Browser, tmp_path: Path) -> None:
    if not AXE.exists():
        pytest.skip("axe-core is not there: make node_modules/.installed")
    async with open_page(browser, tmp_path) as (_, page, _):
        await expect(page.get_by_label("Watching needs a token")).to_be_visible()
        found = await page.evaluate("axe.run()")
        assert [violation["id"] for violation in found["violations"]] == []
