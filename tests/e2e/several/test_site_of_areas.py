"""A site divided by area: who walks from one area into the other keeps the number, and is served there."""

from __future__ import annotations

import asyncio
from pathlib import Path

import aiohttp
import pytest

from benchmarks.common.browser import chromium
from client import elsewhere, objects, watch
from fakes.page.browser import new_page
from fakes.programs import needs_chromium
from fakes.running.several_services import configuration, several_services
from fakes.timeouts import PATIENCE, PATIENCE_MS

pytestmark = [needs_chromium, pytest.mark.live, pytest.mark.slow]

WALK = "scene:room?camera={camera}&cameras=2&objects=1&seed=11"
"""A person who is in the west of the room for eleven seconds, and then for nineteen in its east."""
WEST, EAST = [0.0, -20.0, 5.5, 30.0], [5.5, -20.0, 30.0, 30.0]
FILM_S = 16.0
PLAYS = "globalThis.myview?.state === 'playing'"


def site_of_areas(folder: Path) -> Path:
    """Write the configuration of a room with a service for each half, and cameras that see all of it."""
    areas = [
        {"cameras": ["c0"], "also": ["c1"], "floor": WEST},
        {"cameras": ["c1"], "also": ["c0"], "floor": EAST},
    ]
    return configuration(
        folder,
        site={"fps": 10, "width": 320, "height": 180},
        sync={"start_timeout_s": 60},
        track={"joint": True},
        sharding={"of": 2, "areas": areas},
        cameras=[{"id": f"c{camera}", "source": WALK.format(camera=camera)} for camera in range(2)],
    )


def at(url: str, number: int) -> str:
    """Return where the page shows a person."""
    return f"{url}?object={number}"


async def is_visible_at(other: str, url: str, number: int) -> bool:
    """Return whether the service at `url` says that another one sees a person."""
    return (number, other) in [(one.object, one.server) for one in await elsewhere(url) if one.visible]


async def test_who_walks_into_another_area_is_watched_there_under_the_same_number(tmp_path: Path) -> None:
    async with (
        chromium() as browser,  # before the walk begins
        several_services(site_of_areas(tmp_path), cameras=["camera-c0", "camera-c1"]) as site,
        asyncio.timeout(2 * PATIENCE),
    ):
        west, east = site.urls
        page = await new_page(browser, bypass_csp=True)  # its policy forbids to evaluate strings
        [number] = await site.numbers(0)
        filming = asyncio.create_task(watch(west, number, tmp_path / "film.mp4", FILM_S))
        await page.goto(at(west, number))
        await page.wait_for_function(PLAYS, timeout=PATIENCE_MS)
        while not await is_visible_at(east, west, number):  # noqa: ASYNC110 — a walk has no event
            await asyncio.sleep(0.05)
        assert number not in [one.object for one in await objects(west) if one.visible]
        assert number in [one.object for one in await objects(east) if one.visible]
        await page.wait_for_url(at(east, number), timeout=PATIENCE_MS)
        await page.wait_for_function(PLAYS, timeout=PATIENCE_MS)
        async with aiohttp.ClientSession() as session:
            for path in (f"objects/{number}/best.mp4", f"objects/{number}/hls/index.m3u8"):
                async with session.get(west + path, allow_redirects=False) as answer:
                    assert (answer.status, answer.headers["Location"]) == (307, east + path)
                async with session.get(west + path) as answer:
                    assert await answer.content.read(100)
        film = await filming
        assert film.complete
        assert len(film.more_files) == 1, "the first area's, and the second's"
