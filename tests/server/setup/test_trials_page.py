"""Several cameras are tried at once on the set-up page: none hides what became of another."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, closing, suppress
from pathlib import Path

import pytest
from playwright.async_api import Browser, Page, expect

from fakes.media.rtsp_camera import RtspCamera
from fakes.page.accessibility import page_violations
from fakes.page.browser import new_page
from fakes.paths import AXE
from fakes.programs import needs_chromium
from fakes.service.scripted_cameras import encoded
from fakes.setup.onvif_camera import FakeProfile, OnvifCamera, onvif_cameras
from fakes.timeouts import PATIENCE
from server.http.setup_app import serve_setup
from server.setup import session, trial_messages
from server.setup.session import SetupSession
from server.setup.trial_messages import StreamRequest, StreamTrial, try_stream

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="module")]


@asynccontextmanager
async def setup_page(browser: Browser, folder: Path) -> AsyncIterator[Page]:
    """Open the page of a set-up; what fails in the page fails the test."""
    url = asyncio.get_running_loop().create_future()
    serving = asyncio.create_task(serve_setup(SetupSession(folder / "site.yaml"), 0, url.set_result))
    errors: list[str] = []
    try:
        page = await new_page(browser, bypass_csp=True)
        page.on("pageerror", lambda error: errors.append(str(error)))
        await page.goto(await url)
        await expect(page.locator("#search-state")).not_to_have_text(re.compile("Searching|^$"))
        yield page
        await page.close()
    finally:
        serving.cancel()
        with suppress(asyncio.CancelledError):
            await serving
    assert errors == []


LATE = "rtsp://127.0.0.1:9/live"


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch) -> asyncio.Event:
    """Hold the trial of the address LATE, at which there is no camera, until this event is set."""
    is_set = asyncio.Event()

    async def try_later(request: StreamRequest) -> StreamTrial:
        if request.source == LATE:
            await is_set.wait()
        return await try_stream(request)

    monkeypatch.setattr(session, "try_stream", try_later)
    monkeypatch.setattr(trial_messages, "TRIAL_S", PATIENCE)
    monkeypatch.setattr(trial_messages, "_QUERY_S", PATIENCE)
    return is_set


def camera() -> RtspCamera:
    units = encoded(0, 40)
    return RtspCamera([units[at : at + 5] for at in range(0, 40, 5)], 12.5, live=True)


async def try_address(page: Page, address: str) -> None:
    await page.get_by_label("Or an address").fill(address)
    await page.get_by_role("button", name="Try", exact=True).click()


async def test_each_address_that_is_tried_has_a_line_of_its_own(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answers: asyncio.Event
) -> None:
    monkeypatch.setenv("MYVIEW_DISCOVERY", "127.0.0.1:9")
    with closing(camera()) as works:
        async with setup_page(browser, tmp_path) as page:
            lines = page.get_by_role("list", name="Trials of addresses").locator("li")
            await try_address(page, LATE)
            await expect(lines).to_have_text([f"Trying {LATE}…"])
            await try_address(page, works.url)
            added = f"{works.url} sends pictures and was added."
            await page.get_by_label("Or an address").fill("rtsp://10.0.0.7/typed-meanwhile")
            await expect(lines).to_have_text([f"Trying {LATE}…", added])
            name = page.get_by_label(re.compile("Name of the camera"))
            await name.fill("half-typ")
            answers.set()
            await expect(lines.first).to_have_text(
                re.compile("^rtsp://127.0.0.1:9/.*: cannot open this video")
            )
            await expect(lines.last).to_have_text(added)
            await expect(name).to_be_focused()
            await expect(name).to_have_value("half-typ")
            await expect(page.get_by_label("Or an address")).to_have_value("rtsp://10.0.0.7/typed-meanwhile")
            await try_address(page, works.url)
            again = "this camera is in the list already"
            await expect(lines).to_have_text([re.compile("cannot open"), re.compile(again)])
            if AXE.exists():
                assert await page_violations(page) == []


async def test_a_trial_of_a_found_camera_is_reported_at_that_camera_and_survives_a_search(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answers: asyncio.Event
) -> None:
    pytest.importorskip("onvif", reason="needs onvif-zeep-async: the extra onvif")
    with closing(camera()) as works:
        cameras = [
            OnvifCamera(name, [FakeProfile("main", url, 64, 48, 12)])
            for name, url in (("door", LATE), ("yard", works.url))
        ]
        with onvif_cameras(*cameras) as targets:
            monkeypatch.setenv("MYVIEW_DISCOVERY", targets)
            async with setup_page(browser, tmp_path) as page:
                for name in ("door", "yard"):
                    item = page.locator("#found > li", has_text=name)
                    ask = item.get_by_role("button", name=re.compile("Show its streams"))
                    await ask.focus()
                    await page.keyboard.press("Enter")
                    await expect(item).to_contain_text("1 stream.")
                    await expect(ask).to_be_focused()
                    await page.keyboard.press("Tab")
                    await page.keyboard.press("Enter")
                    await expect(item.get_by_role("button", name=re.compile("Try main"))).to_be_focused()
                door, yard = (
                    page.get_by_role("list", name=f"Trials of {name}").locator("li")
                    for name in ("door", "yard")
                )
                await expect(yard).to_have_text("127.0.0.1 main sends pictures and was added.")
                await expect(door).to_have_text("Trying 127.0.0.1 main…")
                await page.get_by_role("button", name="Search the network").click()
                await expect(page.locator("#search-state")).to_have_text(re.compile("found"))
                answers.set()
                await expect(door).to_contain_text("127.0.0.1 main: cannot open this video")
                await expect(yard).to_contain_text("was added.")
                if AXE.exists():
                    assert await page_violations(page) == []


async def test_a_trial_goes_on_and_is_reported_when_the_page_is_reloaded_or_left(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answers: asyncio.Event
) -> None:
    monkeypatch.setenv("MYVIEW_DISCOVERY", "127.0.0.1:9")
    async with setup_page(browser, tmp_path) as page:
        lines = page.get_by_role("list", name="Trials of addresses").locator("li")
        await try_address(page, "rtsp://viewer:p@ss:w/rd#?%@127.0.0.1:9/live")
        await expect(lines).to_have_text([re.compile(f"^{LATE}: its password has a character that ends")])
        await try_address(page, f" {LATE} ")
        await expect(lines.last).to_have_text(f"Trying {LATE}…")
        await page.wait_for_function("Object.values(sessionStorage).join().includes('trial')")
        await page.reload()
        await expect(lines).to_have_text([f"Trying {LATE}…"])
        await page.goto("about:blank")
        await page.go_back()
        await expect(lines).to_have_text([f"Trying {LATE}…"])
        answers.set()
        await expect(lines).to_have_text([re.compile(f"^{LATE}: cannot open this video")])
        await page.reload()
        await expect(page.locator("#search-state")).not_to_have_text("")
        await expect(lines).to_have_count(0)


async def test_the_keyboard_goes_on_after_a_removal_and_another_pages_change_is_shown(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answers: asyncio.Event
) -> None:
    del answers  # trials are waited for
    monkeypatch.setenv("MYVIEW_DISCOVERY", "127.0.0.1:9")
    with closing(camera()) as first, closing(camera()) as second:
        async with setup_page(browser, tmp_path) as page:
            names = page.get_by_label(re.compile("Name of the camera"))
            for count, works in enumerate((first, second), 1):
                await try_address(page, works.url)
                await expect(names).to_have_count(count)
            await page.evaluate(
                """() => fetch('api/operator/setup/cameras/1',
                    { method: 'DELETE', headers: { 'X-MyView-Changes': '1' } })"""
            )
            await names.first.fill("gone")
            await page.keyboard.press("Tab")
            await expect(page.locator("#error-message")).to_have_text("no such camera")
            await expect(names).to_have_count(1)
            await try_address(page, first.url)
            await expect(names).to_have_count(2)
            for left in (names.first, page.get_by_label("Or an address")):
                await page.get_by_role("button", name=re.compile("Remove")).last.focus()
                await page.keyboard.press("Enter")
                await expect(left).to_be_focused()
            await expect(names).to_have_count(0)
