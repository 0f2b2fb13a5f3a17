"""Child processes: all processes that the server starts, and their setup.

There are five kinds: commands of this program (started by the supervisor), modules that answer over standard
input and output (the best-view service's workers), modules on the system's Python (the RTSP gateway),
functions in a new interpreter (`myview render`), and other programs that are waited for (`myview models`).
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import multiprocessing
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from server.system.niceness import lower_priority

TERMINATION_SIGNALS = (signal.SIGINT, signal.SIGTERM)
SPAWN = multiprocessing.get_context("spawn")
"""The context for queues that are passed to :func:`start_function`."""
_PR_SET_PDEATHSIG = 1
_WORKER_NICENESS = 5
"""Workers have a lower priority than the service, and cameras than both (`site.niceness`)."""


async def start_cli_command(
    arguments: Sequence[str],
    environment: Mapping[str, str],
    *,
    inherited: Sequence[int] = (),
    niceness: int = 0,
) -> asyncio.subprocess.Process:
    """Start a command of this program, such as ``["camera", "site.yaml", "c0"]``, as a process.

    ``inherited`` are file descriptors that stay open in it. ``niceness`` is added to that of this process.

    Raises:
        OSError: it cannot be started.
    """
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "server.cli.main",
        *arguments,
        env=environment,
        pass_fds=inherited,
        process_group=0,  # only the supervisor receives Ctrl-C
    )
    lower_priority(process.pid, niceness)
    return process


async def start_worker(module: str) -> asyncio.subprocess.Process:
    """Start a module that reads requests from standard input and writes answers to standard output.

    Raises:
        OSError: it cannot be started.
    """
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        module,
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # the other cores are the cameras'
        process_group=0,  # only the service receives Ctrl-C
    )
    lower_priority(process.pid, _WORKER_NICENESS)
    return process


_ON_PYTHON = (
    "import runpy, sys; sys.path.insert(0, sys.argv[1]); runpy.run_module(sys.argv[2], run_name='__main__')"
)
_ROOT = Path(__file__).parents[2]
"""The folder of the package `server`."""


async def start_on_python(python: Path, module: str, line_bytes: int) -> asyncio.subprocess.Process:
    """Start a module of this program on another Python, which has none of this one's libraries.

    It reads standard input; standard output and error are one pipe, of lines of at most ``line_bytes``.

    Raises:
        OSError: it cannot be started.
    """
    return await asyncio.create_subprocess_exec(
        str(python),
        "-IBc",
        _ON_PYTHON,
        str(_ROOT),
        module,
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
        limit=line_bytes,
    )


def run_on_python(python: Path, code: str, timeout_s: float) -> subprocess.CompletedProcess[str]:
    """Run code on another Python until it ends.

    Raises:
        OSError: it cannot be started.
        subprocess.TimeoutExpired: it took longer; it has been killed.
    """
    return subprocess.run(  # noqa: S603 — no shell
        [str(python), "-Ic", code], capture_output=True, text=True, timeout=timeout_s, check=False
    )


def run_program(command: Sequence[str], folder: Path, timeout_s: float) -> subprocess.CompletedProcess[str]:
    """Run another program in a folder until it ends; the folder of the program is on its path.

    Raises:
        OSError: it cannot be started.
        subprocess.TimeoutExpired: it took longer; it has been killed.
    """
    path = os.pathsep.join([str(Path(command[0]).parent), os.environ.get("PATH", os.defpath)])
    return subprocess.run(  # noqa: S603 — no shell
        command,
        capture_output=True,
        text=True,
        timeout=timeout_s,
        check=False,
        cwd=folder,
        env={**os.environ, "PATH": path},
    )


def start_function(name: str, function: Callable[..., None], *arguments: Any) -> BaseProcess:
    """Start a function in a new interpreter, which ends with this process and ignores Ctrl-C.

    Function and arguments are pickled. Start several within :func:`defer_termination`.
    """
    process = SPAWN.Process(target=_run_function, args=(function, *arguments), name=name, daemon=True)
    process.start()
    return process


def _run_function(function: Callable[..., None], *arguments: Any) -> None:
    terminate_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C and ends its workers
    unblock_termination()
    function(*arguments)


def terminate_with_parent() -> None:
    """Let the kernel send this process SIGTERM when its parent dies (Linux only)."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


@contextmanager
def defer_termination() -> Iterator[None]:
    """Defer SIGINT and SIGTERM until the block ends; only in the main thread.

    A signal mask alone is not enough: a thread of a library may receive the signal, and Python runs the
    handler in the main thread. The mask is set for children, which would print a traceback if terminated
    while they start; they call :func:`unblock_termination`.
    """
    received: list[int] = []
    before = {
        number: signal.signal(number, lambda number, _: received.append(number))
        for number in TERMINATION_SIGNALS
    }
    signal.pthread_sigmask(signal.SIG_BLOCK, TERMINATION_SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, TERMINATION_SIGNALS)
        for number, handler in before.items():
            signal.signal(number, handler)
        if received:
            signal.raise_signal(received[0])


def unblock_termination() -> None:
    """Unblock SIGINT and SIGTERM in a child that was started within :func:`defer_termination`."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, TERMINATION_SIGNALS)
