"""Deletion of a person's data on the operator's page: what is confirmed is what is shown."""

from __future__ import annotations

import asyncio

from playwright.async_api import Page, Route, expect

from benchmarks.common.browser import chromium
from fakes.page.operator_page import open_operator_page
from fakes.programs import needs_chromium
from fakes.service.fed_site import show_people

pytestmark = needs_chromium


async def ask(page: Page, number: int) -> None:
    await page.get_by_label("Number", exact=True).fill(str(number))
    await page.get_by_role("button", name="What would be deleted").click()


async def test_a_late_answer_about_somebody_else_changes_nothing() -> None:
    async with chromium() as browser, open_operator_page(browser, "#people") as (served, page):
        show_people(served)
        first, second = served.service.decider.people.known
        asked, answers = asyncio.Event(), asyncio.Event()

        async def answer_late(route: Route) -> None:
            asked.set()
            await answers.wait()
            await route.continue_()

        await page.route(f"**/api/operator/deletion?object={first}", answer_late)
        await ask(page, first)
        await asked.wait()
        await ask(page, second)
        plan = page.locator("#delete-plan li").first
        await expect(plan).to_contain_text(f"number {second},")
        async with page.expect_response(f"**/api/operator/deletion?object={first}") as late:
            answers.set()
        await (await late.value).finished()
        await page.evaluate("new Promise((done) => setTimeout(done))")  # the page has read it
        await expect(plan).to_contain_text(f"number {second},")
        await page.get_by_label("Keep recorded video and sound").check()
        await page.get_by_role("button", name="Delete for good").click()
        await expect(page.locator("#delete-state")).to_have_text(f"The data of person {second} are deleted.")
        assert first in served.service.decider.people.known
        assert second not in served.service.decider.people.known
