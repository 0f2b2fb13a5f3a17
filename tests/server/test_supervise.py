"""The supervisor: what dies is restarted, what is done stays done, what was refused ends everything."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest
from cameras_by_hand import small_config
from patience import PATIENCE

from server.run import supervise
from server.run.ending import OVER
from server.run.supervise import Supervisor
from server.wire.errors import UserError


class Process:
    """A process by hand."""

    def __init__(self, arguments: tuple[str, ...]) -> None:
        self.arguments = arguments
        self.returncode: int | None = None
        self._over = asyncio.Event()

    def end(self, code: int) -> None:
        self.returncode = code
        self._over.set()

    async def wait(self) -> int:
        await self._over.wait()
        assert self.returncode is not None
        return self.returncode

    def terminate(self) -> None:
        self.end(-15)

    kill = terminate


class Machine:
    """A machine on which a supervisor starts processes by hand."""

    def __init__(self) -> None:
        self.started: asyncio.Queue[Process] = asyncio.Queue()
        self.task: asyncio.Task[None] | None = None

    async def start(self, *_: str, **__: Any) -> Process:
        process = Process(_[3:])
        self.started.put_nowait(process)
        return process

    async def processes(self, count: int) -> dict[str, Process]:
        """Give the next processes by what they are."""
        found = [await self.started.get() for _ in range(count)]
        return {
            process.arguments[-1 if process.arguments[0] == "camera" else 0]: process for process in found
        }

    def run(
        self, out: Path | None = None, before_start: Callable[[], None] = lambda: None
    ) -> asyncio.Task[None]:
        supervisor = Supervisor(Path("site.yaml"), small_config(), {}, out, before_start)
        self.task = asyncio.create_task(supervisor.run())
        return self.task


@pytest.fixture
async def machine(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Machine]:
    it = Machine()
    monkeypatch.setattr(asyncio, "create_subprocess_exec", it.start)
    monkeypatch.setattr(supervise, "_RETRY_FIRST_S", 0.0)
    async with asyncio.timeout(PATIENCE):
        yield it
        if it.task is not None:
            it.task.cancel()
            await asyncio.gather(it.task, return_exceptions=True)


async def test_everything_is_started_and_ended_together(machine: Machine) -> None:
    task = machine.run()
    processes = await machine.processes(4)
    assert set(processes) == {"bestview", "sync", "c0", "c1"}
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    assert all(process.returncode == -15 for process in processes.values())


@pytest.mark.parametrize("code", [-9, 1, 0])
async def test_what_dies_or_is_told_to_end_is_started_again_alone(
    machine: Machine, code: int, caplog: pytest.LogCaptureFixture
) -> None:
    machine.run()
    processes = await machine.processes(4)
    for _ in range(3):
        processes["c0"].end(code)
        processes |= await machine.processes(1)
        assert processes["c0"].returncode is None
    assert machine.started.empty()
    assert len(caplog.messages) == 1, "told of once for one cause"


async def test_what_is_needed_to_start_is_seen_to_before_every_start(machine: Machine) -> None:
    seen: list[int] = []
    machine.run(before_start=lambda: seen.append(len(seen)))
    processes = await machine.processes(4)
    assert len(seen) == 4
    processes["c0"].end(-9)
    await machine.processes(1)
    assert len(seen) == 5


async def test_a_camera_whose_recording_is_over_stays_so_and_the_best_views_end_ends_everything(
    machine: Machine,
) -> None:
    task = machine.run()
    processes = await machine.processes(4)
    processes["c0"].end(OVER)
    processes["bestview"].end(OVER)
    await task
    assert machine.started.empty()
    assert processes["c1"].returncode == processes["sync"].returncode == -15


async def test_what_refuses_its_input_at_the_start_ends_everything(machine: Machine) -> None:
    task = machine.run()
    processes = await machine.processes(4)
    processes["c1"].end(2)
    with pytest.raises(UserError, match="c1 could not start"):
        await task
    assert all(process.returncode is not None for process in processes.values())


async def test_what_once_ran_is_tried_again_even_when_it_refuses(machine: Machine) -> None:
    machine.run()
    processes = await machine.processes(4)
    for code in (-9, 2, 2):
        processes["c0"].end(code)
        processes |= await machine.processes(1)


async def test_a_restarted_best_view_writes_beside_what_it_wrote_before(machine: Machine) -> None:
    machine.run(Path("out"))
    processes = await machine.processes(4)
    written = [processes["bestview"].arguments]
    for _ in range(2):
        processes["bestview"].end(-9)
        processes |= await machine.processes(1)
        written.append(processes["bestview"].arguments)
    assert [arguments[-2:] for arguments in written] == [
        ("--out", "out"),
        ("--out", "out/restart-1"),
        ("--out", "out/restart-2"),
    ]
