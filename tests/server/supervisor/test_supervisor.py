"""The supervisor restarts processes that die, not those that have finished, and ends on refused input."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import yaml

from fakes.system.supervised_processes import Machine, Process
from fakes.timeouts import PATIENCE
from server.config.running_config import ACTIVE_CONFIG_VARIABLE, ActiveConfig
from server.supervisor import supervisor
from server.supervisor.shutdown import EXIT_FINISHED, EXIT_RESTART
from server.supervisor.site import run_up
from server.supervisor.startup_signal import REFUSAL_VARIABLE, REFUSED_RESTART_VARIABLE
from server.system.errors import UserError


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


async def test_a_process_that_has_run_for_long_is_restarted_even_if_it_refuses_its_input(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "_REFUSAL_S", -1.0)  # any time since it has loaded is long
    machine.run()
    processes = await machine.processes(4)
    processes["c0"].end(2)
    assert set(await machine.processes(1)) == {"c0"}


async def test_a_process_that_loads_for_long_may_still_refuse_its_input(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "_STARTUP_TIMEOUT_S", 0.01)
    machine.loads_at_once = False
    task = machine.run()
    (await machine.processes(4))["c1"].end(2)
    with pytest.raises(UserError, match="c1 could not start"):
        await task


async def test_a_process_that_ran_before_is_restarted_even_if_it_refuses_its_input(machine: Machine) -> None:
    machine.run()
    processes = await machine.processes(4)
    for code in (-9, 2, 2):
        processes["c0"].end(code)
        processes |= await machine.processes(1)


MISFIT = "camera c1: passthrough: pass: its frames are 64x48, the site's 640x360"


def write_site(path: Path, source: str) -> None:
    cameras = [
        {"id": "c0", "source": "rtsp://10.0.0.1/"},
        {"id": "c1", "source": source, "passthrough": "pass"},
    ]
    path.write_text(yaml.safe_dump({"cameras": cameras}))


def refuse(process: Process, reason: str) -> None:
    Path(process.environment[REFUSAL_VARIABLE]).write_text(f"{reason}\n")
    process.end(2)


def active_source(process: Process) -> str:
    """Return the source of c1 in the configuration that a process reads."""
    content = yaml.safe_load(Path(process.environment[ACTIVE_CONFIG_VARIABLE]).read_text())
    return str(content["cameras"][1]["source"])


async def test_a_restart_that_a_process_refuses_goes_back_to_the_earlier_configuration(
    machine: Machine, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "site.yaml"
    write_site(path, "rtsp://10.0.0.2/")
    running = ActiveConfig(path)
    machine.task = asyncio.create_task(run_up(running, {}, None))
    processes = await machine.processes(4)
    write_site(path, "rtsp://10.0.0.3/")
    processes["bestview"].end(EXIT_RESTART)
    processes = await machine.processes(4)
    assert active_source(processes["c1"]) == "rtsp://10.0.0.3/"
    refuse(processes["c1"], MISFIT)
    processes = await machine.processes(4)
    assert active_source(processes["c1"]) == "rtsp://10.0.0.2/"
    assert f"{MISFIT}; all processes start again with the previous configuration" in caplog.messages
    assert processes["bestview"].environment[REFUSED_RESTART_VARIABLE] == MISFIT
    refuse(processes["c1"], "that camera sends something else by now, too")  # but it has run: others go on
    assert set(await machine.processes(1)) == {"c1"}
    assert processes["c0"].returncode is processes["bestview"].returncode is None
    write_site(path, "rtsp://10.0.0.4/")
    processes["bestview"].end(EXIT_RESTART)
    processes = await machine.processes(4)
    assert active_source(processes["c1"]) == "rtsp://10.0.0.4/"
    assert processes["bestview"].environment[REFUSED_RESTART_VARIABLE] == ""


async def test_a_configuration_that_was_never_in_force_ends_the_site_if_refused(
    machine: Machine, tmp_path: Path
) -> None:
    write_site(tmp_path / "site.yaml", "rtsp://10.0.0.2/")
    machine.task = asyncio.create_task(run_up(ActiveConfig(tmp_path / "site.yaml"), {}, None))
    refuse((await machine.processes(4))["c1"], MISFIT)
    with pytest.raises(UserError, match="c1 could not start"):
        await machine.task


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
