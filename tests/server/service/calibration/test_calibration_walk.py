"""The calibration walk over HTTP: coverage while walking, calibration in a separate process."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import aclosing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fakes.cli.calibration_walk import (
    HEIGHT,
    SITE,
    WIDTH,
    curved_path,
    errors_on_floor,
    walk_config,
    walk_epochs,
)
from fakes.service.fed_site import A, B, ServedSite, serve_site
from fakes.service.scripted_cameras import FPS, STRIDE
from server.config.loader import build_config
from server.http.access.csrf import CSRF_HEADER
from server.service.calibration import walk_session as walk_session_module
from server.service.calibration.walk_session import WalkSession, WalkState
from server.service.calibration.worker import CalibrationResult, CalibrationTask, CameraBoxes, run_calibration

WALK = "/api/operator/walk"
MINE = {CSRF_HEADER: "1"}


@pytest.fixture
async def wide() -> AsyncIterator[ServedSite]:
    """Serve a site whose pictures are large enough to walk in."""
    async with aclosing(serve_site(**SITE)) as sites:
        yield await anext(sites)


async def do(served: ServedSite, **step: Any) -> tuple[int, Any]:
    async with served.session.post(WALK, headers=MINE, json=step) as answer:
        return answer.status, await answer.json()


async def finished(served: ServedSite) -> Any:
    assert served.service.walk_session._task is not None
    await served.service.walk_session._task
    return await served.get_json(WALK)


def walk(served: ServedSite, frames: int, epoch: int = 0, **settings: Any) -> None:
    for walk_epoch in walk_epochs(served.service.config, curved_path(frames, **settings), epoch):
        served.service.walk_session.add(walk_epoch)


async def test_a_walk_yields_the_scenes_homographies(wide: ServedSite, tmp_path: Path) -> None:
    before = wide.service.config
    assert (await wide.get_json(WALK))["state"] == "none"
    status, content = await do(wide, action="start")
    assert (status, content["state"], content["seconds"]) == (200, "walking", 0.0)
    walk(wide, 500)
    content = await wide.get_json(WALK)
    assert content["seconds"] == 500 / FPS
    [pair] = content["pairs"]
    assert (pair["one"], pair["other"]) == (A, B)
    assert 5 < pair["seconds"] <= 20
    for camera in content["cameras"]:
        assert sum(camera["thirds"]) == pytest.approx(1.0)
        assert camera["foot_points"] == round(pair["seconds"] * FPS / 5)
    status, content = await do(wide, action="finish")
    assert (status, content["state"]) == (200, "working")
    content = await finished(wide)
    assert (content["state"], content["error"]) == ("done", "")
    assert content["lines"][0].startswith("feet that two cameras see are ")
    async with wide.session.get(f"{WALK}/ground.json") as answer:
        assert answer.headers["Content-Disposition"] == 'attachment; filename="ground.json"'
        (tmp_path / "ground.json").write_bytes(await answer.read())
    async with wide.session.get(f"{WALK}/plan.png") as answer:
        assert (await answer.read()).startswith(b"\x89PNG")
    cameras = [{"id": name, "source": "scene:room"} for name in (A, B)]
    assert content["configuration"].startswith("ground: ground.json\n")
    config = build_config({"cameras": cameras, "ground": "ground.json"}, where="walk", folder=tmp_path)
    errors = errors_on_floor([np.array(camera.ground) for camera in config.cameras])
    assert np.median(errors) < 0.15  # meters
    assert wide.service.config == before  # the active configuration is unchanged
    async with wide.session.delete(WALK, headers=MINE) as answer:
        assert (await answer.json())["state"] == "none"
    assert await wide.get(f"{WALK}/ground.json") == (404, {"error": "there is no calibration result yet"})


async def test_an_insufficient_walk_is_reported_and_can_be_resumed(wide: ServedSite) -> None:
    await do(wide, action="start")
    walk(wide, 50, wide=0.0)
    await do(wide, action="finish")
    content = await finished(wide)
    assert content["state"] == "done"
    assert content["error"].startswith(f"{A} and {B}: ")
    assert (content["lines"], content["configuration"]) == ([], "")
    _, content = await do(wide, action="resume")
    assert (content["state"], content["seconds"], content["error"]) == ("walking", 2.0, "")
    walk(wide, 50, epoch=10)
    assert (await wide.get_json(WALK))["seconds"] == 4.0


async def test_uncovered_areas_are_reported_during_the_walk(wide: ServedSite) -> None:
    await do(wide, action="start")
    assert len((await wide.get_json(WALK))["uncovered"]) == 2  # no camera has windows
    walk(wide, 100, wide=0.01)
    losses = (await wide.get_json(WALK))["uncovered"]
    assert f"walk also nearer to camera {A}, and farther from it" in losses


@pytest.mark.parametrize(
    ("step", "status", "error"),
    [
        ({"action": "finish"}, 409, "there is no walk: start one first"),
        ({"action": "resume"}, 409, "there is no walk: start one first"),
        ({"action": "fly"}, 400, "the request's JSON: "),
        ({"action": "start", "person": 0}, 400, "the request's JSON: "),
        ({}, 400, "the request's JSON: "),
    ],
)
async def test_invalid_steps_are_refused(served: ServedSite, step: Any, status: int, error: str) -> None:
    code, content = await do(served, **step)
    assert code == status
    assert content["error"].startswith(error)
    assert served.service.walk_session.state is WalkState.NONE


async def task_of(tasks: list[CalibrationTask], config: Any, *parts: Any) -> CalibrationTask:
    """Simulate a walk; return the task of the calibration process."""

    async def note(task: CalibrationTask) -> CalibrationResult:
        tasks.append(task)
        return CalibrationResult()

    active_walk = WalkSession(config, note)
    active_walk.start()
    for part in parts:
        part(active_walk)
    active_walk.finish(1.7)
    assert active_walk._task is not None
    await active_walk._task
    return tasks[-1]


async def test_every_final_box_is_recorded_once_and_counted_from_the_start_of_the_walk() -> None:
    config = walk_config()
    places = curved_path(100)

    def before_and_on(active_walk: WalkSession) -> None:
        active_walk.discard()
        for walk_epoch in walk_epochs(config, places[:50]):  # no walk has started
            active_walk.add(walk_epoch)
        active_walk.start()
        for walk_epoch in walk_epochs(config, places[50:], epoch=10):
            active_walk.add(walk_epoch)
            active_walk.add(walk_epoch)  # earlier boxes are not counted again

    task = await task_of([], config, before_and_on)
    assert task.person_height == 1.7
    for camera_boxes in task.cameras:
        frames = np.frombuffer(camera_boxes.frames, dtype=np.int64)
        assert len(set(frames.tolist())) == len(frames)
        assert frames.min() >= 0
        assert frames.max() <= 49
        boxes = np.frombuffer(camera_boxes.boxes, dtype=np.float64).reshape(-1, 4)
        assert len(boxes) == len(frames) == len(np.frombuffer(camera_boxes.track, dtype=np.int64))


async def test_a_restarted_camera_has_other_tracks() -> None:
    config = walk_config()

    def twice(active_walk: WalkSession) -> None:
        for boot in (1, 2):
            for walk_epoch in walk_epochs(config, curved_path(50), epoch=10 * (boot - 1), boot=boot):
                active_walk.add(walk_epoch)

    task = await task_of([], config, twice)
    track_index = np.frombuffer(task.cameras[0].track, dtype=np.int64)
    assert set(track_index.tolist()) == {0, 1}


async def test_a_walk_started_before_any_camera_counts_from_the_first_window() -> None:
    config = walk_config()

    def late(active_walk: WalkSession) -> None:
        for walk_epoch in walk_epochs(config, curved_path(50), epoch=10_000_000):
            active_walk.add(walk_epoch)

    task = await task_of([], config, late)
    frames = np.frombuffer(task.cameras[0].frames, dtype=np.int64)
    assert 0 <= frames.min() <= frames.max() <= 49


async def test_offsets_are_those_of_recordings_only() -> None:
    cameras = [
        {"id": "c0", "source": "c0.mp4", "offset_s": 0.28},
        {"id": "c1", "source": "rtsp://10.0.0.1/a"},
    ]
    config = walk_config(cameras=cameras)
    assert (await task_of([], config)).offsets == {"c0": 7}


async def test_nothing_is_recorded_beyond_the_longest_walk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(walk_session_module, "MAX_WALK_S", 1.0)
    config = walk_config()
    active_walk = WalkSession(config)
    active_walk.start()
    for walk_epoch in walk_epochs(config, curved_path(100)):
        active_walk.add(walk_epoch)
    assert active_walk.seconds == 1.0


async def test_closing_waits_for_the_end_of_a_cancelled_calibration() -> None:
    ended = asyncio.Event()

    async def calibrate(task: CalibrationTask) -> CalibrationResult:
        del task
        try:
            await asyncio.Event().wait()
        finally:
            await asyncio.sleep(0)  # as while a process is waited for
            ended.set()
        return CalibrationResult()

    session = WalkSession(walk_config(), calibrate)
    session.start()
    session.finish(1.75)
    await asyncio.sleep(0)
    session.discard()
    assert not ended.is_set()
    await session.close()
    assert ended.is_set()


async def test_a_calibration_process_that_dies_is_reported_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    nonsense = CameraBoxes("c0", (WIDTH, HEIGHT), b"123", b"", b"")
    outcome = await run_calibration(CalibrationTask([nonsense], FPS, 0.0, 1.75, {}))
    assert outcome.error == "the calibration failed; see the server's log"
    monkeypatch.setattr("sys.executable", "/nowhere/python")
    outcome = await run_calibration(CalibrationTask([], FPS, 0.0, 1.75, {}))
    assert outcome.error.startswith("the calibration cannot be started: ")


async def test_discarding_the_walk_cancels_its_calibration(wide: ServedSite) -> None:
    await do(wide, action="start")
    walk(wide, 20 * STRIDE)
    await do(wide, action="finish")
    task = wide.service.walk_session._task
    async with wide.session.delete(WALK, headers=MINE) as answer:
        assert json.loads(await answer.read())["state"] == "none"
    assert task is not None
    await asyncio.gather(task, return_exceptions=True)
    assert task.cancelled()
    assert wide.service.walk_session.result is None
