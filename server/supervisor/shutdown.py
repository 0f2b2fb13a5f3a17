"""Shutdown: on SIGTERM or SIGINT a process releases everything and exits with 0."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Coroutine
from typing import Any

from server.system.accept_errors import AcceptErrors
from server.system.child_process import TERMINATION_SIGNALS

log = logging.getLogger(__name__)

SUPERVISED_VARIABLE = "MYVIEW_SUPERVISED"
"""Set in the environment of a supervised process."""
EXIT_FINISHED = 4
"""Exit code of a supervised process that has nothing left to do; 0: it was terminated."""
EXIT_RESTART = 5
"""Exit code of a supervised best-view service whose operator wants all processes to start again."""
_RELEASE_S = 1.2
"""Time limit for releasing everything after a signal; a silent camera would block for longer."""


def is_supervised() -> bool:
    """Return whether this process belongs to a supervisor, which starts it again."""
    return bool(os.environ.get(SUPERVISED_VARIABLE))


async def run_until_signal(
    main: Callable[[], Coroutine[Any, Any, None]],
    on_signal: Callable[[], None] = lambda: None,
    *,
    end_on_sighup: bool = True,
) -> bool:
    """Run a coroutine until it ends, or until a signal cancels it; then ``on_signal`` is called first.

    ``end_on_sighup``: SIGHUP cancels it, too.

    Returns:
        Whether it ended by itself.
    """
    task = asyncio.create_task(main())
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(AcceptErrors())

    def end() -> None:
        on_signal()
        task.cancel()

    for number in (*TERMINATION_SIGNALS, signal.SIGHUP) if end_on_sighup else TERMINATION_SIGNALS:
        loop.add_signal_handler(number, end)
    try:
        await task
    except asyncio.CancelledError:
        return False
    return True


def run_process(
    main: Callable[[], Coroutine[Any, Any, None]],
    release_s: float = _RELEASE_S,
    *,
    end_on_sighup: bool = False,
) -> None:
    """Run a process's coroutine until it ends, or until SIGTERM or SIGINT.

    ``end_on_sighup``: SIGHUP ends it, too; otherwise the coroutine handles SIGHUP.

    After a signal the process has ``release_s`` seconds to release everything and then exits, since a silent
    camera may block a thread.
    """
    finished = asyncio.run(run_until_signal(main, lambda: _end_after(release_s), end_on_sighup=end_on_sighup))
    if finished and is_supervised():
        sys.exit(EXIT_FINISHED)


def _end_after(seconds: float) -> None:
    def end() -> None:
        log.info("shutting down: blocked threads are abandoned")
        os._exit(0)

    timer = threading.Timer(seconds, end)
    timer.daemon = True
    timer.start()
