"""Start child processes: the only place of the server that does, and what a child does when it begins.

Three kinds: commands of this program (a supervisor's), modules that answer over their standard input and
output (the best-view service's workers), and functions in a new interpreter (`myview render`'s workers).
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from multiprocessing.process import BaseProcess
from typing import Any

from server.system.niceness import lower_priority

TERMINATION_SIGNALS = (signal.SIGINT, signal.SIGTERM)
SPAWN = multiprocessing.get_context("spawn")
"""Queues that are handed to :func:`start_function` come from this context."""
_PR_SET_PDEATHSIG = 1
_WORKER_NICENESS = 5
"""Workers yield to the service, which has viewers to serve; cameras yield to both (`site.niceness`)."""


async def start_command(
    arguments: Sequence[str],
    environment: Mapping[str, str],
    *,
    inherited: Sequence[int] = (),
    niceness: int = 0,
) -> asyncio.subprocess.Process:
    """Start a command of this program, such as ``["camera", "site.yaml", "c0"]``, as a process of its own.

    ``inherited``: file descriptors that stay open in it. ``niceness`` is added to that of this process.

    Raises:
        OSError: the system does not let it start.
    """
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "server.cli.main",
        *arguments,
        env=environment,
        pass_fds=inherited,
        process_group=0,  # Ctrl-C in a terminal is for the supervisor alone
    )
    lower_priority(process.pid, niceness)
    return process


async def start_worker(module: str) -> asyncio.subprocess.Process:
    """Start a module that reads requests from its standard input and writes answers to its standard output.

    Raises:
        OSError: the system does not let it start.
    """
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        module,
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        process_group=0,  # Ctrl-C in a terminal is for the service alone
    )
    lower_priority(process.pid, _WORKER_NICENESS)
    return process


def start_function(name: str, function: Callable[..., None], *arguments: Any) -> BaseProcess:
    """Start a function in a new interpreter, which ends with this process and leaves Ctrl-C to it.

    Function and arguments are pickled. Several are started within :func:`defer_termination`.
    """
    process = SPAWN.Process(target=_run_function, args=(function, *arguments), name=name, daemon=True)
    process.start()
    return process


def _run_function(function: Callable[..., None], *arguments: Any) -> None:
    terminate_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends its workers
    restore_termination()
    function(*arguments)


def terminate_with_parent() -> None:
    """Ask the kernel to send this process SIGTERM when its parent dies (Linux; elsewhere nothing happens)."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


@contextmanager
def defer_termination() -> Iterator[None]:
    """Put off SIGINT and SIGTERM until the block is over; only in the main thread.

    The mask alone is not enough: a library's thread may take the signal, and Python then runs the handler in
    this one. It is set too because children inherit it: one that is terminated while it starts would print
    a traceback. They call :func:`restore_termination`.
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


def restore_termination() -> None:
    """Unblock SIGINT and SIGTERM in a child that was started within :func:`defer_termination`."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, TERMINATION_SIGNALS)
