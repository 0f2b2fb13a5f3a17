"""Operator corrections work: the tracker exchanges two people, and pointing at one of them corrects it."""

from __future__ import annotations

import asyncio
from pathlib import Path

import aiohttp
import pytest
from playwright.async_api import Page

from client import Gop
from client.model import Split
from fakes.programs import needs_chromium
from fakes.running.assist_page import PERSON_POSITION_JS, assisted_site, check_every_gop_once, open_page
from fakes.running.lookalikes import FRAMES, MEETING, STANDING, write_camera
from fakes.running.site import RunningSite
from fakes.running.stream_frames import FPS
from fakes.timeouts import PATIENCE, PATIENCE_MS

pytestmark = [
    pytest.mark.live,
    pytest.mark.slow,
    pytest.mark.asyncio,
    needs_chromium,
]
ALIKE = "crossing"


def left_to_right(gop: Gop) -> list[int]:
    """Return the ids of the two people from left to right; empty if the order changes within the GOP."""
    rows = {tuple(box.object for box in sorted(row, key=lambda box: box.left)) for row in gop.boxes[ALIKE]}
    return list(rows.pop()) if len(rows) == 1 else []


async def test_pointing_at_a_person_restores_their_id_without_interrupting_the_stream(tmp_path: Path) -> None:
    """The person from the left turns back; the tracker assumes that the two pass each other."""
    # One camera with given detections, so that a busy machine keeps up.
    cameras = [write_camera(ALIKE, tmp_path)]
    async with assisted_site(tmp_path, cameras, memory_s=FRAMES / FPS) as site, open_page(site) as page:
        await point(site, page)


async def point(site: RunningSite, page: Page) -> None:
    gops = site.gops
    await site.until(lambda: gops[-1].first > MEETING, "they have met")
    before = [
        gop for gop in gops if gop.first + gop.frames <= MEETING and len(left_to_right(gop)) == len("LR")
    ]
    first, second = left_to_right(before[-1])
    await site.until(lambda: left_to_right(gops[-1]) == [second, first], "the tracker exchanges them")
    await page.goto(f"{site.url}?object={first}")
    await page.wait_for_function(f"myview.state === 'playing' && myview.camera === '{ALIKE}'")
    await page.evaluate("document.querySelector('video').dataset.same = 'yes'")
    await page.wait_for_function(
        f"!document.querySelector('#point').hidden && ({PERSON_POSITION_JS})({second})"
    )
    # While they walk, the pointer of a busy machine lags behind them.
    await page.wait_for_function(f"myview.pulse >= {STANDING}")
    await page.keyboard.press("h")
    await page.wait_for_function(f"myview.pointing.object === {first}")
    # They stand: the pointer stays on the person from the left, whose id is now the other one.
    accepted = "myview.pointing.accepted >= 1"
    async with asyncio.timeout(PATIENCE_MS / 1000):
        while not await page.evaluate(accepted):
            pulse = await page.evaluate("myview.pulse")
            place = await page.evaluate(PERSON_POSITION_JS, second)
            if place is not None:
                await page.mouse.move(*place)
            await page.wait_for_function(f"myview.pulse !== {pulse} || {accepted}")
    exchanged = {Split(first, second, ALIKE), Split(second, first, ALIKE)}
    await site.until(
        lambda: any(exchanged <= {*gop.split} for gop in gops), "the camera's solution is corrected"
    )
    corrected = next(index for index, gop in enumerate(gops) if exchanged <= {*gop.split})
    assert left_to_right(gops[corrected - 1]) == [second, first], "published GOPs do not change"
    assert left_to_right(gops[corrected]) == [first, second], "the ids are those before they met"
    assert gops[corrected].choices[first] == ALIKE
    # The page shows it, in the same player.
    left = f"myview.boxes.some(([it, left]) => it === {first} && left < myview.site.width / 2)"
    await page.wait_for_function(f"myview.pulse >= {gops[corrected].first} && {left}")
    await page.wait_for_function(f"myview.state === 'playing' && myview.pulse > {gops[corrected].first} + 10")
    assert await page.evaluate(left)
    assert await page.evaluate("document.querySelector('video').dataset.same") == "yes"
    check_every_gop_once(site)
    await check_report(site)


async def check_report(site: RunningSite) -> None:
    """Check that the flag counts as answered, and that service and camera count the corrections."""
    async with aiohttp.ClientSession(site.url) as session:
        async with session.get("api/flags") as answer:
            states = {flag["state"] for flag in (await answer.json())["flags"]}
        assert states & {"followed", "answered"}
        async with asyncio.timeout(PATIENCE):  # the camera reports once a second
            while not await corrections(session, "myview_camera_position_corrections_total"):
                await site.next_gop()
        assert await corrections(session, "myview_position_corrections_total") >= 1


async def corrections(session: aiohttp.ClientSession, metric: str) -> float:
    async with session.get("metrics") as answer:
        lines = (await answer.text()).splitlines()
    return sum(float(line.split()[-1]) for line in lines if line.startswith(metric))
