"""Operator assistance on the running demo: a flag is raised, a pointer follows, the camera is corrected."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import aiohttp
import pytest
import pytest_asyncio
from playwright.async_api import Page

from fakes.programs import needs_chromium
from fakes.running.assist_page import PERSON_POSITION_JS, assisted_site, check_every_gop_once, open_page
from fakes.running.site import RunningSite
from fakes.timeouts import PATIENCE_MS
from server.cli.generated_config import DEMO

pytestmark = [
    pytest.mark.live,
    pytest.mark.slow,
    pytest.mark.asyncio(loop_scope="module"),
    needs_chromium,
]


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def site(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[RunningSite]:
    """The demo."""
    async with assisted_site(tmp_path_factory.mktemp("demo"), DEMO["cameras"]) as site:
        yield site


@pytest_asyncio.fixture(loop_scope="module")
async def page(site: RunningSite) -> AsyncIterator[Page]:
    """The page, open_page."""
    async with open_page(site) as page:
        yield page


async def point_until(page: Page, condition: str) -> None:
    """Keep the pointer on the flagged person, and answer further flags, until a condition holds."""
    async with asyncio.timeout(PATIENCE_MS / 1000):
        while not await page.evaluate(condition):
            if await page.evaluate("myview.pointing.object === null && myview.flags.length > 0"):
                await page.keyboard.press("h")
            place = await page.evaluate(PERSON_POSITION_JS)
            if place is not None:
                await page.mouse.move(*place)
            pulse = await page.evaluate("myview.pulse")
            await page.wait_for_function(f"myview.pulse !== {pulse} || ({condition})")


async def metric(site: RunningSite, name: str) -> float:
    async with aiohttp.ClientSession() as session, session.get(f"{site.url}metrics") as answer:
        lines = (await answer.text()).splitlines()
    return sum(float(line.split()[-1]) for line in lines if line.startswith(name))


async def test_a_scripted_pointer_answers_a_flag_without_interrupting_the_stream(
    site: RunningSite, page: Page
) -> None:
    await page.wait_for_function("myview.state === 'playing'")
    await page.evaluate("document.querySelector('video').dataset.same = 'yes'")
    point = page.locator("#flag-point")
    await page.wait_for_function("myview.flags.length && !document.querySelector('#flag-point').hidden")
    assert (await page.locator("#flag-text").inner_text()).strip()
    await point.click()
    await page.wait_for_function("myview.pointing.object !== null")
    await point_until(page, "myview.pointing.accepted >= 20")
    sent = await metric(site, "myview_position_corrections_total")
    assert sent >= 20
    async with asyncio.timeout(PATIENCE_MS / 1000):  # the camera reports once a second
        while await metric(site, "myview_camera_position_corrections_total") < 1:
            await page.wait_for_function(f"myview.pulse > {await page.evaluate('myview.pulse')} + 5")
    async with aiohttp.ClientSession() as session, session.get(f"{site.url}api/flags") as answer:
        states = {flag["state"] for flag in (await answer.json())["flags"]}
    assert states & {"followed", "answered"}
    await page.keyboard.press("Escape")
    await page.wait_for_function("myview.pointing.object === null")
    pulse = await page.evaluate("myview.pulse")
    await page.wait_for_function(f"myview.state === 'playing' && myview.pulse > {pulse} + 10")
    assert await page.evaluate("document.querySelector('video').dataset.same") == "yes"
    check_every_gop_once(site)
