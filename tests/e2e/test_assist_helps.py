"""Operator corrections help: two people are taken for each other, and pointing at them corrects it."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from playwright.async_api import Page

from client import Gop
from client.model import Split
from fakes.programs import needs_chromium
from fakes.running.assist_page import PLACE, every_gop_once, helped, opened
from fakes.running.lookalikes import FRAMES, MET, STAND, camera
from fakes.running.site import RunningSite
from fakes.timeouts import PATIENCE_MS

pytestmark = [
    pytest.mark.live,
    pytest.mark.asyncio,
    needs_chromium,
]
ALIKE = "crossing"


def left_to_right(gop: Gop) -> list[int]:
    """Return who is shown by the camera of the two; empty where they change within the GOP."""
    rows = {tuple(box.object for box in sorted(row, key=lambda box: box.left)) for row in gop.boxes[ALIKE]}
    return list(rows.pop()) if len(rows) == 1 else []


async def test_who_is_pointed_at_has_their_number_again_and_the_stream_goes_on(tmp_path: Path) -> None:
    """Who came from the left went back there; the tracker has the two pass each other."""
    # One camera, whose boxes are given: also a machine with much to do sees how they meet.
    cameras = [camera(ALIKE, tmp_path)]
    async with helped(tmp_path, cameras, memory_frames=FRAMES) as site, opened(site) as page:
        await point(site, page)


async def point(site: RunningSite, page: Page) -> None:
    gops = site.gops
    await site.until(lambda: gops[-1].first > MET, "they have met")
    came = [gop for gop in gops if gop.first + gop.frames <= MET and len(left_to_right(gop)) == len("LR")]
    who, other = left_to_right(came[-1])
    await site.until(lambda: left_to_right(gops[-1]) == [other, who], "their tracker exchanges them")
    await page.goto(f"{site.url}?object={who}")
    await page.wait_for_function(f"myview.state === 'playing' && myview.camera === '{ALIKE}'")
    await page.evaluate("document.querySelector('video').dataset.same = 'yes'")
    await page.wait_for_function(f"!document.querySelector('#point').hidden && ({PLACE})({other})")
    # While they walk, a busy machine's hand is behind them, where nobody is.
    await page.wait_for_function(f"myview.pulse >= {STAND}")
    await page.keyboard.press("h")
    await page.wait_for_function(f"myview.pointing.object === {who}")
    # They stand: the hand, too, stays where the one who came from the left is, whatever number is there.
    taken = "myview.pointing.taken >= 1"
    while not await page.evaluate(taken):
        pulse = await page.evaluate("myview.pulse")
        place = await page.evaluate(PLACE, other)
        if place is not None:
            await page.mouse.move(*place)
        await page.wait_for_function(f"myview.pulse !== {pulse} || {taken}")
    exchanged = {Split(who, other, ALIKE), Split(other, who, ALIKE)}
    async with asyncio.timeout(PATIENCE_MS / 1000):
        await site.until(lambda: any(exchanged <= {*gop.split} for gop in gops), "the camera solves anew")
    place = next(n for n, gop in enumerate(gops) if exchanged <= {*gop.split})
    assert left_to_right(gops[place - 1]) == [other, who], "what was told before stays"
    assert left_to_right(gops[place]) == [who, other], "what is told next is as they were before they met"
    assert gops[place].choices[who] == ALIKE
    # The page shows it, in the film that it has played all the time.
    left = f"myview.boxes.some(([it, left]) => it === {who} && left < myview.site.width / 2)"
    await page.wait_for_function(f"myview.pulse >= {gops[place].first} && {left}")
    await page.wait_for_function(f"myview.state === 'playing' && myview.pulse > {gops[place].first} + 10")
    assert await page.evaluate(left)
    assert await page.evaluate("document.querySelector('video').dataset.same") == "yes"
    assert every_gop_once(site)
