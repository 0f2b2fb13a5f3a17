"""The process that tracks jointly: the same tracks as in this process, and a new process where it dies."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Sequence

import numpy as np
import pytest

from fakes.service.joint_floor import joint_config, walk_past, walked_epochs
from fakes.timeouts import PATIENCE
from server.service.joint_tracking import worker as worker_module
from server.service.joint_tracking.stage import JointStage
from server.service.joint_tracking.worker import JointWorker
from server.system.worker import process as process_module
from server.system.worker.process import WorkerDiedError, WorkerProcess


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait for the process however busy the machine is."""
    for name in ("_ANSWER_S", "_LATE_S"):
        monkeypatch.setattr(worker_module, name, PATIENCE)
    monkeypatch.setattr(process_module, "START_S", PATIENCE)


@pytest.mark.usefixtures("patient")
async def test_the_process_gives_the_same_tracks() -> None:
    config, epochs = joint_config(), list(walked_epochs(walk_past(16)))
    worker, stage = JointWorker(config), JointStage(config)
    try:
        async with asyncio.timeout(PATIENCE):
            assert [await worker.step(epoch) for epoch in epochs] == [stage.step(epoch) for epoch in epochs]
    finally:
        await worker.close()


@pytest.mark.usefixtures("patient")
async def test_the_process_is_started_before_the_first_epoch() -> None:
    worker = JointWorker(joint_config())
    try:
        async with asyncio.timeout(PATIENCE):
            await worker.start()
            pid = worker.pid
            assert pid is not None
            assert (await worker.step(next(iter(walked_epochs(walk_past()))))).joint is not None
            assert worker.pid == pid
    finally:
        await worker.close()


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
async def test_a_process_that_dies_or_hangs_is_replaced(
    how: signal.Signals, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    epochs = list(walked_epochs(walk_past()))
    worker = JointWorker(joint_config())
    try:
        async with asyncio.timeout(PATIENCE):
            before = [await worker.step(epoch) for epoch in epochs[:8]][-1]
            assert worker.pid is not None
            os.kill(worker.pid, how)
            monkeypatch.setattr(worker._worker, "_answer_s", 0.1)
            lost = await worker.step(epochs[8])
            after = [await worker.step(epoch) for epoch in epochs[9:-1]][-1]
    finally:
        await worker.close()
    assert before.joint is not None
    assert (lost.joint, lost.tracks["c0"].tracks) == (None, [])
    assert after.joint is not None
    assert after.joint.tracks.run == before.joint.tracks.run + 1
    assert len(after.tracks["c0"].tracks) == 2
    assert sum("started anew" in record.message for record in caplog.records) == 1


@pytest.mark.usefixtures("patient")
async def test_decisions_do_not_wait_for_a_process_that_is_late(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    epochs = iter(walked_epochs(walk_past()))
    worker = JointWorker(joint_config())
    try:
        async with asyncio.timeout(PATIENCE):
            assert (await worker.step(next(epochs))).joint is not None
            pid = worker.pid
            assert pid is not None
            os.kill(pid, signal.SIGSTOP)
            monkeypatch.setattr(worker, "_least_patience_s", 0.01)
            worker._slowest_s = 0.0
            late = [await worker.step(next(epochs)) for _ in range(3)]
            os.kill(pid, signal.SIGCONT)
            assert worker._answer is not None
            await worker._answer
            assert worker._patience_s > 0.01, "an answer that was late lets the next ones take longer"
            monkeypatch.setattr(worker, "_least_patience_s", PATIENCE)
            assert (await worker.step(next(epochs))).joint is not None
            assert worker.pid == pid
    finally:
        await worker.close()
    assert [(epoch.joint, epoch.tracks["c0"].tracks) for epoch in late] == [(None, [])] * 3
    assert sum("is late" in record.message for record in caplog.records) == 1


@pytest.mark.usefixtures("patient")
async def test_a_process_that_was_late_knows_what_was_observed_meanwhile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    config, epochs = joint_config(), list(walked_epochs(walk_past()))[:16]
    worker, stage = JointWorker(config), JointStage(config)
    expected = [stage.step(epoch) for epoch in epochs]
    found = []
    try:
        async with asyncio.timeout(PATIENCE):
            for number, epoch in enumerate(epochs):
                if number == 4:
                    assert worker.pid is not None
                    os.kill(worker.pid, signal.SIGSTOP)
                    monkeypatch.setattr(worker, "_least_patience_s", 0.01)
                    worker._slowest_s = 0.0
                if number == 7:
                    assert worker.pid is not None
                    assert worker._answer is not None
                    os.kill(worker.pid, signal.SIGCONT)
                    await worker._answer
                    monkeypatch.setattr(worker, "_least_patience_s", PATIENCE)
                found.append(await worker.step(epoch))
    finally:
        await worker.close()
    assert [epoch.joint is None for epoch in found] == [4 <= number < 7 for number in range(16)]
    assert found[8:] == expected[8:]


async def test_a_process_that_dies_again_and_again_is_replaced_less_often(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    starts = 0

    async def fail(*_: object) -> None:
        nonlocal starts
        starts += 1
        raise WorkerDiedError("died")

    monkeypatch.setattr(WorkerProcess, "start", fail)
    monkeypatch.setattr(worker_module, "_RETRY_FIRST_S", 1e6)
    monkeypatch.setattr(worker_module, "_RETRY_MAX_S", 1e6)
    worker = JointWorker(joint_config())
    for epoch in walked_epochs(walk_past()):
        assert (await worker.step(epoch)).tracks["c0"].tracks == []
    assert starts == 2, "once more at once, and then later"


@pytest.mark.usefixtures("patient")
async def test_a_camera_that_disagrees_with_the_others_is_corrected_and_named(
    caplog: pytest.LogCaptureFixture,
) -> None:
    config = joint_config()
    cameras = [
        {
            "id": camera.id,
            "source": camera.source,
            "ground": shifted_ground(camera.ground, 1.0 if camera.id == "c0" else 0.0),
            "ground_unit": "m",
        }
        for camera in config.cameras
    ]
    worker = JointWorker(joint_config(cameras=cameras))
    assert worker.offsets == {}
    try:
        async with asyncio.timeout(PATIENCE):
            for epoch in walked_epochs(walk_past(300)):
                await worker.step(epoch)
    finally:
        await worker.close()
    assert set(worker.offsets) == {"c0", "c1", "c2"}
    assert max(worker.offsets, key=lambda camera: worker.offsets[camera]) == "c0"
    assert worker.offsets["c0"] == pytest.approx(0.67, abs=0.15)
    said = [text for text in caplog.messages if "calibrate the cameras again" in text]
    assert len(said) == 1
    assert said[0].startswith("camera c0 sees people 0.5 m from where the others see them")


def shifted_ground(ground: Sequence[Sequence[float]] | None, meters: float) -> list[list[float]]:
    """Return the homography with all places moved along x."""
    assert ground is not None
    move = np.eye(3)
    move[0, 2] = meters
    moved: list[list[float]] = (move @ np.array(ground)).tolist()
    return moved
