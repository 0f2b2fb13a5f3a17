"""Shutdown: signals are deferred while processes start, and processes exit in time."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fakes.paths import ROOT
from fakes.timeouts import PATIENCE
from server.system.child_process import defer_termination


@pytest.fixture(params=[signal.SIGTERM, signal.SIGINT])
def handled(request: pytest.FixtureRequest) -> Iterator[tuple[signal.Signals, list[int]]]:
    """A signal, and its handled occurrences."""
    received: list[int] = []
    before = signal.signal(request.param, lambda number, _: received.append(number))
    yield request.param, received
    signal.signal(request.param, before)


@pytest.fixture
def other_thread() -> Iterator[int]:
    """A thread that may receive every signal, as a library's threads do; yields its identity."""
    over = threading.Event()
    thread = threading.Thread(target=over.wait, args=(PATIENCE,))
    thread.start()
    assert thread.ident is not None
    yield thread.ident
    over.set()
    thread.join()


def until(received: list[int], length: int) -> None:
    end = time.monotonic() + PATIENCE
    while len(received) < length:
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_signal_is_deferred_even_if_another_thread_receives_it(
    handled: tuple[signal.Signals, list[int]], other_thread: int
) -> None:
    number, received = handled
    with defer_termination():
        for _ in range(5):
            signal.pthread_kill(other_thread, number)
        while number in signal.sigpending():
            pass
        assert received == []
    until(received, 1)
    # The last signal may reach a thread that does not run now.
    assert received in ([number], [number] * 2), "once for repeated signals"
    count = len(received)
    signal.pthread_kill(other_thread, number)
    until(received, count + 1)  # later signals are not deferred


def test_without_a_signal_nothing_happens(handled: tuple[signal.Signals, list[int]]) -> None:
    with defer_termination():
        pass
    assert handled[1] == []


def test_a_child_inherits_the_signal_mask_and_can_restore_it() -> None:
    code = (
        "import signal; from server.system.child_process import unblock_termination as again\n"
        "def blocked(): return {2, 15} & set(signal.pthread_sigmask(signal.SIG_BLOCK, ()))\n"
        "before = blocked(); again(); print(len(before), len(blocked()))"
    )
    with defer_termination():
        result = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, check=True
        )
    assert result.stdout.split() == ["2", "0"]


def test_a_process_with_a_blocked_thread_exits(tmp_path: Path) -> None:
    started = tmp_path / "started"
    script = (
        "import asyncio, pathlib, sys, time\n"
        "from server.supervisor.shutdown import run_process\n"
        "def held_up(): pathlib.Path(sys.argv[1]).touch(); time.sleep(60)\n"
        "async def main(): await asyncio.to_thread(held_up)\n"
        "run_process(main, release_s=0.3)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", script, str(started)])
    until_true(started.exists)
    process.terminate()
    assert process.wait(PATIENCE) == 0, "the thread would have slept for a minute"


def test_a_process_terminated_while_loading_exits_with_0(tmp_path: Path) -> None:
    hurried = subprocess.Popen([sys.executable, "-m", "server.cli.main", "sync", str(tmp_path / "none.yaml")])
    status = Path(f"/proc/{hurried.pid}/status")
    until_true(
        lambda: caught(status.read_text(encoding="ascii"), signal.SIGTERM) or hurried.poll() is not None
    )
    hurried.terminate()
    assert hurried.wait(PATIENCE) == 0, "the missing configuration was not read yet"


_CTRL_C = """
import os, signal, sys

class CtrlC:
    def find_spec(self, name, path=None, target=None):
        if name == os.environ["PRESSED_AT"]:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, CtrlC())
"""
"""Code that presses Ctrl-C while a command still loads."""
_LOADED_FIRST, _LOADED_LATER = "server.cli.site_commands", "server.config.loader"
"""Modules that are loaded before and after the command is known."""


@pytest.mark.parametrize(
    ("command", "loads", "code"),
    [
        (["token", "nobody"], _LOADED_FIRST, -signal.SIGINT),
        (["render", "none.mp4", "--out", "out", "--config", "none.yaml"], _LOADED_LATER, 130),
        (["up", "none.yaml"], _LOADED_FIRST, 0),
        (["up", "none.yaml"], _LOADED_LATER, 0),
    ],
)
def test_ctrl_c_while_a_command_loads_ends_it_silently(
    tmp_path: Path, command: list[str], loads: str, code: int
) -> None:
    result = pressed(tmp_path, command, loads)
    assert (result.returncode, result.stdout, result.stderr) == (
        code,
        "",
        "",
    )


def test_a_command_started_with_ignored_sigint_ignores_it_while_loading(tmp_path: Path) -> None:
    ignored = "signal.signal(signal.SIGINT, signal.SIG_IGN)"
    result = pressed(tmp_path, ["token", "nobody"], _LOADED_FIRST, ignored)
    assert result.returncode == 0, result.stderr
    assert "nobody" in result.stdout


def pressed(
    folder: Path, command: list[str], loads: str, before: str = ""
) -> subprocess.CompletedProcess[str]:
    (folder / "sitecustomize.py").write_text(_CTRL_C + before, encoding="ascii")
    return subprocess.run(
        [sys.executable, "-m", "server.cli.main", *command],
        env=os.environ
        | {
            "PYTHONPATH": os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]),
            "PRESSED_AT": loads,
        },
        capture_output=True,
        text=True,
        check=False,
    )


def caught(status: str, number: signal.Signals) -> bool:
    mask = next(line for line in status.splitlines() if line.startswith("SigCgt")).split()[1]
    return bool(int(mask, 16) >> number - 1 & 1)


def until_true(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def waits_for_a_file(pid: int) -> bool:
    """Return whether a thread of a process is blocked in the system call that opens a file."""
    opening = {"2", "257", "56"}  # open and openat, as Linux counts them on x86 and ARM
    try:
        calls = [path.read_text(encoding="ascii") for path in Path(f"/proc/{pid}/task").glob("*/syscall")]
    except OSError:
        return False
    return any(call.split()[0] in opening for call in calls)


@pytest.mark.skipif(not Path("/proc/self/syscall").exists(), reason="needs to see what a process waits for")
@pytest.mark.parametrize(
    ("command", "number", "code"),
    [
        ("track pipe --out tracks.txt", signal.SIGINT, 130),
        ("track pipe --out tracks.txt", signal.SIGTERM, 143),
        pytest.param("track --det pipe --out tracks.txt", signal.SIGINT, 130, marks=pytest.mark.slow),
        ("render pipe --out out", signal.SIGINT, 130),
        pytest.param("render pipe --out out --config site.yaml", signal.SIGINT, 130, marks=pytest.mark.slow),
        pytest.param("calibrate pipe --out ground.json", signal.SIGINT, 130, marks=pytest.mark.slow),
        ("doctor site.yaml", signal.SIGINT, 130),
    ],
)
def test_a_command_that_waits_for_a_pipe_ends_silently_on_a_signal(
    tmp_path: Path, command: str, number: signal.Signals, code: int
) -> None:
    """FFmpeg fails with its own error when interrupted, which is not a bug."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "site.yaml").write_text("cameras: [{id: c0, source: pipe}]", encoding="ascii")
    before = sorted(tmp_path.iterdir())
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    arguments = [sys.executable, "-m", "server.cli.main", *command.split()]
    with subprocess.Popen(
        arguments, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            held = 0
            end = time.monotonic() + PATIENCE
            while held < 10:  # other files are opened in no time
                held = held + 1 if waits_for_a_file(process.pid) else 0
                assert process.poll() is None
                assert time.monotonic() < end
                time.sleep(0.01)
            process.send_signal(number)
            out, err = process.communicate(timeout=PATIENCE)
        finally:
            process.kill()
    assert (process.returncode, err) == (code, "")
    assert "pipe" not in out
    assert sorted(tmp_path.iterdir()) == before
