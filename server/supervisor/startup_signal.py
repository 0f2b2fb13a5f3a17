"""The signal by which a started process reports that it has loaded, so that the next one can start.

A process loads for a second of a processor's time or two. Forty that do so together keep each other, and
those that have to answer meanwhile.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

STARTED_FD_VARIABLE = "MYVIEW_STARTED_FD"
"""In the environment of a process that a supervisor starts: the descriptor that it closes once loaded."""


def signal_started() -> None:
    """Notify the supervisor, if there is one, that this process has started; idempotent."""
    with contextlib.suppress(ValueError, OSError):
        os.close(int(os.environ.pop(STARTED_FD_VARIABLE, "")))


@dataclass(frozen=True, slots=True)
class StartupPipe:
    """Its end tells that a process has started, or has died.

    Attributes:
        own: the supervisor's end.
        given: the other one, which the process inherits and closes.
    """

    own: int
    given: int

    async def ended(self, within_s: float) -> None:
        """Wait until all other ends are closed, at most so many seconds."""
        ended = asyncio.Event()
        loop = asyncio.get_running_loop()
        loop.add_reader(self.own, ended.set)
        try:
            # Not wait_for: up to Python 3.11 who is cancelled just when it is over is not cancelled by it.
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(within_s):
                    await ended.wait()
        finally:
            loop.remove_reader(self.own)


@contextmanager
def open_startup_pipe() -> Iterator[StartupPipe]:
    """Open a pipe; its supervisor's end is closed with the block, the other one by its caller."""
    own, given = os.pipe()
    try:
        yield StartupPipe(own, given)
    finally:
        os.close(own)
