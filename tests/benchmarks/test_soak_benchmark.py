"""The soak test: growth is detected and noise is not; and its accelerated site."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import numpy as np
import pytest
from aiohttp import web
from aiohttp.test_utils import TestServer

from benchmarks.soak.accelerated_site import CAMERAS, HEIGHT, WIDTH, LoopedRecordings, TimeScale
from benchmarks.soak.samples import (
    DELAY,
    DESCRIPTORS,
    RESIDENT,
    ProcessSample,
    descriptors_of,
    judge,
    resident_of,
    threads_of,
)
from benchmarks.soak.task_counts import FOLDER_VARIABLE, hooked_environment, note_tasks, read_object_counts
from benchmarks.soak.visitors import StreamDelays, Visitors, fragment_span
from fakes.timeouts import PATIENCE
from server.config.loader import build_config
from server.media.containers import fmp4

HOURS = np.linspace(0.1, 24.0, 200)


def test_what_warms_up_and_then_stays_is_flat() -> None:
    noise = np.random.default_rng(1).normal(0.0, 2.0, len(HOURS))
    assert RESIDENT.judge(HOURS, 200.0 - 100.0 * np.exp(-HOURS) + noise).flat


def test_a_slow_leak_is_found() -> None:
    assert not RESIDENT.judge(HOURS, 200.0 + HOURS).flat
    assert not DESCRIPTORS.judge(HOURS, 40.0 + np.floor(HOURS / 3.0)).flat


def test_the_delay_of_a_machine_with_other_work_is_judged_by_its_best_times() -> None:
    busy = np.where((HOURS > 14.0) & (np.arange(len(HOURS)) % 3 > 0), 2000.0, 0.0)
    assert DELAY.judge(HOURS, 300.0 + busy).flat
    assert not DELAY.judge(HOURS, 300.0 + 10.0 * HOURS).flat


@pytest.mark.parametrize("hours", [[], [0.0] * 10, [0.1, 0.2, 24.0]])
def test_what_was_not_seen_is_not_flat(hours: list[float]) -> None:
    assert not DELAY.judge(hours, [300.0] * len(hours)).flat


def test_every_quantity_of_a_process_is_judged_by_itself() -> None:
    samples = [
        ProcessSample(hour, 100.0, 10, 5 + (hour > 16.0) * 2, 7, 1000)
        for hour in map(float, np.linspace(0.1, 24.0, 40))
    ]
    assert [verdict.rule.name for verdict in judge(samples) if not verdict.flat] == ["threads"]


def test_a_process_is_read_as_it_is() -> None:
    before, pid = descriptors_of(os.getpid()), os.getpid()
    with Path(__file__).open(encoding="utf-8"):
        assert descriptors_of(pid) == before + 1
    assert resident_of(pid) > 10.0
    assert threads_of(pid) >= 1
    with pytest.raises(OSError, match="No such"):
        resident_of(2**22 + 1)


def test_a_process_counts_its_own_tasks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.soak.task_counts._EVERY_S", 0.01)
    monkeypatch.setattr(asyncio.BaseEventLoop, "run_forever", asyncio.BaseEventLoop.run_forever)
    note_tasks(str(tmp_path))

    async def count_three() -> tuple[int, int]:
        async with asyncio.TaskGroup() as tasks:
            counts = [tasks.create_task(_count_at_least_three(tmp_path)) for _ in range(2)]
        return counts[0].result(), counts[1].result()

    assert asyncio.run(count_three()) == (3, 3)
    assert hooked_environment(tmp_path)[FOLDER_VARIABLE] == str(tmp_path)


async def _count_at_least_three(folder: Path) -> int:
    """Wait until the process has noted all tasks; a slow machine notes once before they are there."""
    async with asyncio.timeout(PATIENCE):
        while True:
            counts = [count.tasks for count in read_object_counts(folder).values()]
            if max(counts, default=0) >= 3:
                return max(counts)
            await asyncio.sleep(0.005)


def test_what_is_kept_is_counted_in_the_time_of_the_site(tmp_path: Path) -> None:
    time_scale = TimeScale(20.0)
    recordings = LoopedRecordings(tmp_path, time_scale)
    for camera in CAMERAS:
        (tmp_path / f"{camera}.mp4").touch()
    content = {
        "site": recordings.site,
        "cameras": [{**camera, "source": "scene:room"} for camera in recordings.cameras],
        **recordings.settings(tmp_path / "recorded", 3.0),
    }
    config = build_config(content, where="soak", folder=tmp_path)
    assert (config.site.width, config.site.height) == (WIDTH, HEIGHT)
    assert config.record.keep_s * time_scale.speed == pytest.approx(3.0 * 3600.0)
    assert config.view.buffer_s * config.site.fps == pytest.approx(60.0 * 3.0)
    assert time_scale.hours(time_scale.pulse(24.0)) == pytest.approx(24.0)


def test_a_stream_has_a_hole_where_there_is_nothing_to_show_and_not_where_a_picture_lasts() -> None:
    delays = StreamDelays()
    pictures = [
        fmp4.fragment([fmp4.FragmentSample(b"a", key=True)], 10, 25.0),
        fmp4.fragment([fmp4.FragmentSample(b"b", key=False), fmp4.FragmentSample(b"c", key=False)], 11, 25.0),
        fmp4.still_fragment([fmp4.FragmentSample(b"d", key=False)], 13, 90, 25.0),
        fmp4.fragment([fmp4.FragmentSample(b"e", key=True)], 90, 25.0),
        fmp4.fragment([fmp4.FragmentSample(b"f", key=True)], 94, 25.0),
    ]
    for place, data in enumerate(pictures):
        span = fragment_span(data[4:], 25.0)
        assert span is not None
        delays.add(span, 400.0)
        assert delays.missing_frames == (3 if place == 4 else 0)
    assert (delays.pulse, delays.until) == (94, 95)
    assert fragment_span(b"mdat" + pictures[0], 25.0) is None


async def test_a_person_may_be_forgotten_and_a_camera_may_not() -> None:
    async def best(_: web.Request) -> web.Response:
        return web.Response(body=b"".join(FILM), headers={"Connection": "close"})

    async def site(_: web.Request) -> web.Response:
        return web.json_response({"pulse0": 0.0})

    async def objects(_: web.Request) -> web.Response:
        return web.json_response({"objects": [{"object": 1, "visible": True}]})

    app = web.Application()
    app.router.add_get("/api/site", site)
    app.router.add_get("/api/objects", objects)
    app.router.add_get("/objects/1/best.mp4", best)
    app.router.add_get("/cameras/c0/live.mp4", best)
    async with TestServer(app) as server:
        visitors = Visitors(str(server.make_url("/")), 25.0, seed=1, count=0)
        watching = asyncio.create_task(visitors.watch())
        async with asyncio.timeout(PATIENCE):
            while len(visitors.person.delays) < 2 or not visitors.faults:  # noqa: ASYNC110 — nobody tells
                await asyncio.sleep(0.01)
        watching.cancel()
        await asyncio.gather(watching, return_exceptions=True)
    assert "the stream of a camera ended" in visitors.faults
    assert not [fault for fault in visitors.faults if "person" in fault or "people" in fault]
    assert visitors.camera.missing_frames == visitors.person.missing_frames == 0


FILM = [fmp4.fragment([fmp4.FragmentSample(b"a", key=not number)], number, 25.0) for number in range(3)]
