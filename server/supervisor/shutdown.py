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
"""Set in the environment of a process that a supervisor looks after."""
EXIT_FINISHED = 4
"""The code by which such a process says that nothing is left to do; 0 is that of one told to end."""
_LET_GO_S = 1.2
"""How long a process has to let go of everything; a camera that is silent is waited for longer."""


async def run_until_signal(
    main: Callable[[], Coroutine[Any, Any, None]],
    on_signal: Callable[[], None] = lambda: None,
    *,
    hang_up: bool = True,
) -> bool:
    """Run a coroutine until it is over or a signal asks to end, when ``told`` is called first.

    Returns:
        Whether it was over by itself.

    ``hang_up``: SIGHUP asks for that, too.
    """
    task = asyncio.create_task(main())
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(AcceptErrors())

    def end() -> None:
        on_signal()
        task.cancel()

    for number in (*TERMINATION_SIGNALS, signal.SIGHUP) if hang_up else TERMINATION_SIGNALS:
        loop.add_signal_handler(number, end)
    try:
        await task
    except asyncio.CancelledError:
        return False
    return True


def run_process(
    main: Callable[[], Coroutine[Any, Any, None]], let_go_s: float = _LET_GO_S, *, hang_up: bool = False
) -> None:
    """Run a process's coroutine until it is over, or SIGTERM or SIGINT comes.

    ``hang_up``: SIGHUP ends it, too; else it looks after that itself.

    Who is told to end has so many seconds to let go of everything. Then the process ends all the same: a
    thread may be held up by a camera that says nothing, and whoever stops a site would wait for that, too.
    """
    over = asyncio.run(run_until_signal(main, lambda: _end_after(let_go_s), hang_up=hang_up))
    if over and os.environ.get(SUPERVISED_VARIABLE):
        sys.exit(EXIT_FINISHED)


def _end_after(seconds: float) -> None:
    def end() -> None:
        log.info("told to end: what is held up is left as it is")
        os._exit(0)

    timer = threading.Timer(seconds, end)
    timer.daemon = True
    timer.start()
