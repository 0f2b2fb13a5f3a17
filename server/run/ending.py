"""Ending well: on SIGTERM or SIGINT a process lets go of everything and exits with 0."""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import signal
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from typing import Any

_PR_SET_PDEATHSIG = 1
_ENDING = (signal.SIGINT, signal.SIGTERM)


async def run_until_told(main: Callable[[], Coroutine[Any, Any, None]], *, hang_up: bool = True) -> None:
    """Run a coroutine until it is over or a signal asks to end; ``hang_up``: SIGHUP does so, too."""
    task = asyncio.create_task(main())
    loop = asyncio.get_running_loop()
    for number in (*_ENDING, signal.SIGHUP) if hang_up else _ENDING:
        loop.add_signal_handler(number, task.cancel)
    with contextlib.suppress(asyncio.CancelledError):
        await task


def end_with_parent() -> None:
    """Ask the kernel to end this process when its supervisor is gone (Linux; elsewhere nothing)."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


def run_process(main: Callable[[], Coroutine[Any, Any, None]]) -> None:
    """Run a process's coroutine until it is over, or SIGTERM or SIGINT comes; it looks after SIGHUP itself."""
    asyncio.run(run_until_told(main, hang_up=False))


@contextmanager
def ending_later() -> Iterator[None]:
    """Put off SIGINT and SIGTERM until the block is over; only in the main thread.

    The mask alone would not do: a library's thread may take the signal, and Python then runs the
    handler here all the same.  It is set too because children inherit it: one that is told to end while
    it still starts would say so with a traceback.  They call :func:`end_at_once_again`.
    """
    came: list[int] = []
    before = {number: signal.signal(number, lambda number, _: came.append(number)) for number in _ENDING}
    signal.pthread_sigmask(signal.SIG_BLOCK, _ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDING)
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


def end_at_once_again() -> None:
    """In a child that was started within :func:`ending_later`: let SIGINT and SIGTERM through."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDING)
