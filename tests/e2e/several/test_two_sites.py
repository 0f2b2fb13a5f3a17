"""A person walks from one site into another: same number, and the first one's page and API lead there."""

from __future__ import annotations

import asyncio
from fractions import Fraction
from pathlib import Path
from typing import Any

import aiohttp
import av
import pytest
from playwright.async_api import expect

from benchmarks.common.browser import chromium
from client import Objects, watch
from fakes.page.browser import new_page
from fakes.programs import needs_chromium
from fakes.running.site import RunningSite, configuration, running
from fakes.running.stream_frames import FPS
from fakes.timeouts import PATIENCE, PATIENCE_MS
from server.cli.generated_config import free_port
from synthetic import Scene

pytestmark = [needs_chromium, pytest.mark.live, pytest.mark.slow]

WALK_S, SHOWN_S = 6, 180
"""Seconds of walking that are drawn, and shown to and fro."""
WALKER, HOST, STRANGER = 2, 3, 1
"""Who walks from the hall into the yard, who stays in the hall, and who is in the yard."""
LEAVES_S, ARRIVES_S = 12, 3


def record(folder: Path, present: dict[int, range]) -> tuple[Path, Path]:
    """Write a camera's video of the room, and detections of those who are there in these frames."""
    folder.mkdir()
    scene, frames = Scene("room", 1, 3, 1, 320, 180, FPS), WALK_S * FPS
    images = [scene.image(0, frame) for frame in range(frames)]
    truth = [scene.truth(frame)[0] for frame in range(frames)]
    rows = []
    video, detections = folder / "c0.mp4", folder / "c0.txt"
    with av.open(str(video), "w") as container:
        stream = container.add_stream("libx264", rate=FPS, options={"preset": "ultrafast"})
        stream.width, stream.height, stream.pix_fmt = scene.width, scene.height, "yuv420p"
        for number in range(SHOWN_S * FPS):
            at = abs((number + frames) % (2 * frames - 2) - (frames - 1))
            picture = av.VideoFrame.from_ndarray(images[at], format="bgr24")
            picture.pts, picture.time_base = number, Fraction(1, FPS)
            container.mux(stream.encode(picture))
            for person, (left, top, right, bottom) in zip(truth[at].ids, truth[at].boxes, strict=True):
                if number in present.get(int(person), range(0)):
                    size = f"{right - left:g},{bottom - top:g}"
                    rows.append(f"{number + 1},{person},{left:g},{top:g},{size},1,1,1\n")
        container.mux(stream.encode(None))
    detections.write_text("".join(rows), encoding="ascii")
    return video, detections


def site(folder: Path, name: str, ports: dict[str, tuple[int, int]], present: dict[int, range]) -> Path:
    """Write the configuration of a site that is linked with the other one; ports are of bus and page."""
    video, detections = record(folder / name, present)
    (bus, page), index = ports[name], list(ports).index(name)
    links = {
        other: {"connect": f"tcp/127.0.0.1:{bus}", "url": f"http://127.0.0.1:{page}/"}
        for other, (bus, page) in ports.items()
        if other != name
    }
    sections: dict[str, Any] = {
        "site": {"name": name, "fps": FPS},
        "zenoh": {"connect": f"tcp/127.0.0.1:{bus}", "listen": f"tcp/127.0.0.1:{bus}"},
        "http": {"port": page},
        "sites": {"of": 2, "index": index, "link": links},
        "access": {"open_to_all": True},
        "ground": None,
        "cameras": [{"id": "c0", "source": str(video), "detections": str(detections)}],
    }
    return configuration(folder / name, folder, **sections)


def visible(found: Objects | None) -> set[int]:
    return {person.object for person in found.objects if person.visible} if found else set()


async def until_visible(site: RunningSite, count: int) -> set[int]:
    """Wait until so many people are visible; return them."""
    await site.until(lambda: len(visible(site.objects)) == count, f"{count} people in {site.url}")
    return visible(site.objects)


async def test_who_walks_into_another_site_is_watched_there_under_the_same_number(tmp_path: Path) -> None:
    ports = {name: (free_port(), free_port()) for name in ("hall", "yard")}
    always, later = range(SHOWN_S * FPS), range(ARRIVES_S * FPS, SHOWN_S * FPS)
    hall_config = site(tmp_path, "hall", ports, {WALKER: range(LEAVES_S * FPS), HOST: always})
    yard_config = site(tmp_path, "yard", ports, {WALKER: later, STRANGER: later})
    async with running(hall_config) as hall, chromium() as browser, asyncio.timeout(4 * PATIENCE):
        both = await until_visible(hall, 2)
        [host] = await until_visible(hall, 1)
        [walker] = both - {host}
        page = await new_page(browser, bypass_csp=True)  # its policy forbids to evaluate strings
        await page.goto(f"{hall.url}?object={walker}")
        async with running(yard_config) as yard:
            [stranger] = await until_visible(yard, 2) - {walker}
            assert walker in visible(yard.objects)
            assert (walker % 2, host % 2, stranger % 2) == (1, 1, 0)

            def elsewhere() -> dict[int, str | None]:
                found = hall.objects.elsewhere if hall.objects else ()
                return {person.object: person.server for person in found if person.visible}

            await hall.until(lambda: set(elsewhere()) == {walker, stranger}, "the yard's people")
            assert set(elsewhere().values()) == {yard.url}
            async with aiohttp.ClientSession() as session:
                path = f"objects/{walker}/best.mp4"
                async with session.get(hall.url + path, allow_redirects=False) as answer:
                    assert (answer.status, answer.headers["Location"]) == (307, yard.url + path)
            watched = await watch(hall.url, walker, tmp_path / "film.mp4", 2.0)
            assert watched.complete
            await page.wait_for_url(f"{yard.url}?object={walker}", timeout=PATIENCE_MS)
            await expect(page.locator("#site")).to_have_text("yard")
            await page.wait_for_function("globalThis.myview?.state === 'playing'", timeout=PATIENCE_MS)
