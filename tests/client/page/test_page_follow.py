"""The Follow button, snapshots and copied links."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest
from playwright.async_api import Browser

from fakes.page.browser import Visit, visiting
from fakes.page.site import FakeSite
from fakes.page.video_pattern import HEIGHT, SQUARE, WIDTH
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]

BRIGHT = 150
"""Of 255: only person 1's square is brighter in all three colors."""
BROWN = 50
"""Of 255: only person 2's square has a larger difference of red and blue."""


async def bright_share(visit: Visit) -> float:
    """Return the largest of several shares of the stage that the selected person's square takes.

    It moves faster than a person walks, so that it sometimes leaves the viewport.
    """
    return max([await bright_share_now(visit) for _ in range(8)])


async def bright_share_now(visit: Visit) -> float:
    return float((await visit.screenshot() > BRIGHT).all(axis=2).mean())


@pytest.mark.parametrize("boxes", [True, pytest.param(False, marks=pytest.mark.slow)])
async def test_a_followed_person_is_large_and_inside_the_picture(browser: Browser, boxes: bool) -> None:
    async with visiting(browser, FakeSite(people={1: True})) as visit:
        await visit.playing(1)
        if not boxes:
            await visit.page.keyboard.press("b")
        whole = await bright_share(visit)
        assert whole < 2 * SQUARE**2 / WIDTH / HEIGHT
        await visit.page.get_by_role("button", name="Follow").click()
        await visit.until("document.querySelector('#toggle-follow').ariaPressed === 'true'")
        pulse = await visit.get("myview.pulse")
        await visit.until(f"myview.pulse > {pulse + 75}")
        while (
            await bright_share_now(visit) < 4 * whole
        ):  # three times as large in both directions, except for the edges
            pass
        await visit.page.keyboard.press("z")
        pulse = await visit.get("myview.pulse")
        await visit.until(f"myview.pulse > {pulse + 15}")
        assert await bright_share(visit) < 2 * whole


async def test_a_person_is_found_under_the_pointer_while_followed(browser: Browser) -> None:
    async with visiting(browser, query="?object=2") as visit:
        await visit.playing(2)
        await visit.page.keyboard.press("z")
        rows = columns = np.empty(0)
        while not rows.size:
            await visit.get("video.play()")
            pulse = await visit.get("myview.pulse")
            await visit.until(f"myview.pulse > {pulse + 33}")
            await visit.get("video.pause()")
            frame = await visit.screenshot()
            rows, columns = (frame[:, :, 0] - frame[:, :, 2] > BROWN).nonzero()
        position = {"x": float(np.median(columns)), "y": float(np.median(rows))}
        await visit.page.locator("#stage").hover(position=position)
        await visit.until("document.querySelector('#stage').classList.contains('over-person')")


async def test_a_snapshot_is_the_frame_without_boxes(browser: Browser, tmp_path: Path) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.get_by_text("More").click()
        async with visit.page.expect_download() as download:
            await visit.page.get_by_role("button", name="Save this picture").click()
        saved = await download.value
        await saved.save_as(tmp_path / "one.jpg")
        assert saved.suggested_filename.startswith("Test patterns-person-1-c")
        with av.open(str(tmp_path / "one.jpg"), "r") as file:
            picture = next(file.decode(video=0)).to_ndarray(format="rgb24").astype(int)
        assert picture.shape == (HEIGHT, WIDTH, 3)
        green = (picture[:, :, 1] - picture[:, :, [0, 2]].max(axis=2) > 60).mean()
        assert green < 0.001
        assert not await visit.page.locator("#more").get_attribute("open")


async def test_the_link_is_copied(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        await visit.playing(1)
        await visit.page.keyboard.press("l")
        await visit.until("document.querySelector('#notice').textContent.includes('copied')")
        assert await visit.get("navigator.clipboard.readText()") == f"{visit.server.url}?object=1"
