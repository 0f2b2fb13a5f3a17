"""A site that records: killed in the middle of it, everything on the disk plays, and it goes on."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from pathlib import Path

import aiohttp
import numpy as np
import pytest

from fakes.media.decoding import decodes_without_errors
from fakes.running.beeps import sample_and_beep_times, write_beeps
from fakes.running.site import CAMERAS, RunningSite, configuration, running, with_timeout
from fakes.running.stream_frames import FPS, pictures
from fakes.timeouts import PATIENCE
from server.service.facade.past_search import SAMPLE_S

pytestmark = [
    pytest.mark.live,
    pytest.mark.slow,
]


@pytest.fixture
async def site(recording: Path, tmp_path: Path) -> AsyncIterator[RunningSite]:
    """A site that records into segments of two seconds, with people in sight."""
    record = {"folder": str(tmp_path / "kept"), "segment_s": 2.0}
    sound = {"source": str(write_beeps(tmp_path / "beeps.wav")), "at_end": "loop"}
    config = configuration(tmp_path, recording, camera={"at_end": "loop"}, record=record, sound=sound)
    async with running(config) as site:
        await site.until(lambda: bool(site.gops and site.gops[-1].choices), "somebody is shown")
        yield site


def runs(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_dir())


async def test_the_past_is_what_the_cameras_showed_and_a_kill_leaves_all_of_it_playable(
    site: RunningSite, tmp_path: Path
) -> None:
    begun = site.pulse
    await site.until(lambda: site.pulse > begun + 5 * FPS, "some files are whole")
    await by_its_address_it_is_what_the_cameras_showed(site, tmp_path)
    os.kill(site.children()["bestview"], signal.SIGKILL)
    (run,) = runs(tmp_path / "kept")
    files = [*run.glob("cameras/*/*.mp4"), *run.glob("*/*.m3u8")]
    assert len(files) > len(CAMERAS) * 3
    for path in files:
        await asyncio.to_thread(decodes_without_errors, path)
    async with asyncio.timeout(PATIENCE):
        while not any(path != run and any(path.glob("cameras/c0/*.mp4")) for path in runs(tmp_path / "kept")):  # noqa: ASYNC110
            await asyncio.sleep(0.1)


async def by_its_address_it_is_what_the_cameras_showed(site: RunningSite, folder: Path) -> None:
    number = min(site.gops[-1].choices)
    start = next(gop.first for gop in site.gops if number in gop.choices)
    end = site.pulse - FPS
    async with aiohttp.ClientSession(site.url) as session:
        shown = await downloaded(session, f"/objects/{number}/best.mp4?from=p{start}&to=p{end}", folder)
        it_beeps_every_second_without_a_hole(folder / "downloaded.mp4")
        cameras = {
            camera: await downloaded(session, f"/cameras/{camera}/live.mp4?from=p{start}&to=p{end}", folder)
            for camera in CAMERAS
        }
        await a_search_finds_when_they_were_seen(session, site, number, range(start, end))
    assert len(shown) > 3 * FPS
    chosen = {
        pulse: gop.choices.get(number)
        for gop in site.gops
        for pulse in range(gop.first, gop.first + gop.frames)
    }
    for pulse, picture in shown.items():
        camera = chosen.get(pulse)
        if camera is not None and pulse in cameras[camera]:
            np.testing.assert_array_equal(picture, cameras[camera][pulse], f"{pulse}: {camera}")


async def a_search_finds_when_they_were_seen(
    session: aiohttp.ClientSession, site: RunningSite, number: int, pulses: range
) -> None:
    query = f"from=p{pulses.start}&to=p{pulses.stop}&object={number}&min_s=0&gap_s=0"
    async with session.get(f"/api/past/search?{query}") as answer:
        assert answer.status == 200, await answer.text()
        stays = (await with_timeout(answer.json()))["stays"]
    found = {pulse for stay in stays for pulse in range(stay["first"], stay["first"] + stay["frames"])}
    seen = {
        gop.first + place
        for gop in site.gops
        for frames in gop.boxes.values()
        for place, boxes in enumerate(frames)
        if any(box.object == number for box in boxes)
    }
    sampled = {pulse for pulse in seen & set(pulses) if pulse % round(SAMPLE_S * FPS) == 0}
    assert sampled
    assert sampled <= found


def it_beeps_every_second_without_a_hole(film: Path) -> None:
    times, beeps = sample_and_beep_times(film)
    assert np.diff(times) == pytest.approx(1 / 48_000, abs=1e-4)
    assert len(beeps) >= 2
    assert [beep - round(beep) for beep in beeps] == pytest.approx([0] * len(beeps), abs=0.04)


async def downloaded(session: aiohttp.ClientSession, path: str, folder: Path) -> dict[int, np.ndarray]:
    async with session.get(path) as answer:
        assert answer.status == 200, await answer.text()
        data = await with_timeout(answer.read())
    out = folder / "downloaded.mp4"
    out.write_bytes(data + b"\0\0\0\0moof")  # whole to its end, and `pictures` leaves the last one out
    return await asyncio.to_thread(pictures, out)
