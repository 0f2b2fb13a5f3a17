"""The supervisor restarts processes that die, not those that have finished, and ends on refused input."""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest

from fakes.service.scripted_cameras import CAMERAS, small_config
from fakes.timeouts import PATIENCE
from server.supervisor import supervisor
from server.supervisor.shutdown import EXIT_FINISHED, EXIT_RESTART
from server.supervisor.startup_signal import STARTED_FD_VARIABLE
from server.supervisor.supervisor import Supervisor
from server.system.errors import UserError

NOBODY = 2**22 + 1  # more than a process's number can be (proc(5), pid_max)


class Process:
    """A simulated process; ``ready`` is the descriptor that it closes once it has loaded."""

    pid = NOBODY

    def __init__(self, arguments: tuple[str, ...], ready: int) -> None:
        self.arguments = arguments
        self._ready: int | None = ready
        self.returncode: int | None = None
        self._over = asyncio.Event()

    def loaded(self) -> None:
        if self._ready is not None:
            os.close(self._ready)
        self._ready = None

    def end(self, code: int) -> None:
        self.loaded()
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
    """A simulated machine for a supervisor; processes load at once, or when the test lets them."""

    def __init__(self) -> None:
        self.loads_at_once = True
        self.started: asyncio.Queue[Process] = asyncio.Queue()
        self.task: asyncio.Task[None] | None = None
        self.supervisor: Supervisor | None = None

    async def start(self, *command: str, env: dict[str, str], pass_fds: tuple[int], **_: Any) -> Process:
        assert env[STARTED_FD_VARIABLE] == str(pass_fds[0])
        process = Process(command[3:], os.dup(pass_fds[0]))
        if self.loads_at_once:
            process.loaded()
        self.started.put_nowait(process)
        return process

    async def processes(self, count: int) -> dict[str, Process]:
        """Return the next started processes by role."""
        found = [await self.started.get() for _ in range(count)]
        return {
            process.arguments[-1 if process.arguments[0] == "camera" else 0]: process for process in found
        }

    async def nothing_more(self) -> None:
        """Check that no other process is started."""
        for _ in range(20):  # turns of the event loop
            await asyncio.sleep(0)
        assert self.started.empty()

    def run(
        self,
        out: Path | None = None,
        before_start: Callable[[], None] = lambda: None,
        cameras: tuple[str, ...] = CAMERAS,
    ) -> asyncio.Task[None]:
        self.supervisor = Supervisor(Path("site.yaml"), small_config(cameras=cameras), {}, out, before_start)
        self.task = asyncio.create_task(self.supervisor.run())
        return self.task


@pytest.fixture
async def machine(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Machine]:
    machine = Machine()
    monkeypatch.setattr(asyncio, "create_subprocess_exec", machine.start)
    monkeypatch.setattr(supervisor, "_RETRY_FIRST_S", 0.0)
    async with asyncio.timeout(PATIENCE):
        yield machine
        if machine.task is not None:
            machine.task.cancel()
            await asyncio.gather(machine.task, return_exceptions=True)


async def test_all_processes_are_started_and_ended(machine: Machine) -> None:
    task = machine.run()
    processes = await machine.processes(4)
    assert set(processes) == {"bestview", "sync", "c0", "c1"}
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    assert all(process.returncode == -15 for process in processes.values())


async def test_the_best_view_and_the_pulse_server_load_before_any_camera(machine: Machine) -> None:
    machine.loads_at_once = False
    machine.run()
    first = await machine.processes(2)
    assert list(first) == ["bestview", "sync"]
    for process in first.values():
        await machine.nothing_more()
        process.loaded()
    await machine.processes(1)


async def test_at_most_one_camera_per_processor_loads_at_a_time(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "available_processors", lambda: 2.5)
    machine.run(cameras=("c0", "c1", "c2", "c3", "c4"))
    await machine.processes(2)
    machine.loads_at_once = False
    processes = await machine.processes(2)
    assert list(processes) == ["c0", "c1"]
    await machine.nothing_more()
    processes["c0"].loaded()
    processes |= await machine.processes(1)
    await machine.nothing_more()
    processes["c1"].end(-9)  # it ends before it has loaded, and queues again behind the others
    processes |= await machine.processes(1)
    await machine.nothing_more()
    assert list(processes) == ["c0", "c1", "c2", "c3"]
    processes["c3"].loaded()
    assert list(await machine.processes(1)) == ["c4"]
    processes["c2"].loaded()
    assert list(await machine.processes(1)) == ["c1"]


async def test_a_restarted_best_view_does_not_wait_for_loading_cameras(machine: Machine) -> None:
    machine.run()
    processes = await machine.processes(2)
    machine.loads_at_once = False
    await machine.processes(1)
    processes["bestview"].end(-9)
    found = await machine.processes(1)
    while "bestview" not in found:  # the other camera, with more processors
        found |= await machine.processes(1)


async def test_a_process_that_never_reports_loading_delays_others_only_for_a_while(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "_STARTUP_TIMEOUT_S", 0.01)
    machine.loads_at_once = False
    machine.run()
    assert len(await machine.processes(4)) == 4


@pytest.mark.parametrize("code", [-9, 1, 0])
async def test_only_the_process_that_died_or_was_terminated_is_restarted(
    machine: Machine, code: int, caplog: pytest.LogCaptureFixture
) -> None:
    machine.run()
    processes = await machine.processes(4)
    for _ in range(3):
        processes["c0"].end(code)
        processes |= await machine.processes(1)
        assert processes["c0"].returncode is None
    assert machine.started.empty()
    assert len(caplog.messages) == 1, "logged once for each cause"


async def test_the_callback_runs_before_every_start(machine: Machine) -> None:
    received: list[int] = []
    machine.run(before_start=lambda: received.append(len(received)))
    processes = await machine.processes(4)
    assert len(received) == 4
    processes["c0"].end(-9)
    await machine.processes(1)
    assert len(received) == 5


async def test_a_finished_camera_is_not_restarted_and_a_finished_best_view_ends_the_site(
    machine: Machine,
) -> None:
    task = machine.run()
    processes = await machine.processes(4)
    processes["c0"].end(EXIT_FINISHED)
    processes["bestview"].end(EXIT_FINISHED)
    await task
    assert machine.started.empty()
    assert processes["c1"].returncode == processes["sync"].returncode == -15


async def test_the_site_ends_to_start_again_if_the_best_view_says_so(machine: Machine) -> None:
    task = machine.run()
    processes = await machine.processes(4)
    processes["bestview"].end(EXIT_RESTART)
    await task
    assert machine.supervisor is not None
    assert machine.supervisor.restart_wanted
    assert all(process.returncode is not None for process in processes.values())


async def test_a_process_that_refuses_its_input_at_the_start_ends_the_site(machine: Machine) -> None:
    task = machine.run()
    processes = await machine.processes(4)
    processes["c1"].end(2)
    with pytest.raises(UserError, match="c1 could not start"):
        await task
    assert all(process.returncode is not None for process in processes.values())


async def test_a_process_that_ran_before_is_restarted_even_if_it_refuses_its_input(machine: Machine) -> None:
    machine.run()
    processes = await machine.processes(4)
    for code in (-9, 2, 2):
        processes["c0"].end(code)
        processes |= await machine.processes(1)


async def test_a_restarted_best_view_writes_into_a_new_folder(machine: Machine) -> None:
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
