"""Startup signal: a started process reports that it has loaded, so that the next one can start, or why not.

Loading takes one to two seconds of processor time. Forty processes that load at once would slow each other
down, and those that serve meanwhile.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from server.system.private_files import is_owned_by_this_user

STARTED_FD_VARIABLE = "MYVIEW_STARTED_FD"
"""Environment variable with the file descriptor that a supervised process closes once it has loaded."""


def signal_started() -> None:
    """Notify the supervisor, if there is one, that this process has loaded; idempotent."""
    with contextlib.suppress(ValueError, OSError):
        os.close(int(os.environ.pop(STARTED_FD_VARIABLE, "")))


REFUSAL_VARIABLE = "MYVIEW_REFUSAL"
"""Environment variable with a file into which a supervised process writes why it refuses to start."""

REFUSED_RESTART_VARIABLE = "MYVIEW_REFUSED_RESTART"
"""Environment variable that says why the last restart went back to the earlier configuration, if it did."""


def report_refusal(reason: str) -> None:
    """Report to the supervisor, if there is one, why this process refuses to start."""
    name = os.environ.get(REFUSAL_VARIABLE)
    if name is not None and is_owned_by_this_user(Path(name).parent):
        draft = Path(f"{name}.{os.getpid()}")  # several processes may refuse at a time
        with contextlib.suppress(OSError):
            draft.write_text(reason, encoding="utf-8", errors="backslashreplace")
            draft.replace(name)


@dataclass(slots=True)
class StartupPipe:
    """A pipe that reaches its end when a process has loaded or died.

    Attributes:
        read_end: the supervisor's end.
        write_end: the end that the process inherits and closes.
        ended_at: when it has reached its end, by the event loop's clock; None: it has not yet.
    """

    read_end: int
    write_end: int
    ended_at: float | None = None
    _ended: asyncio.Event = field(default_factory=asyncio.Event)

    def end(self) -> None:
        """Take note that all write ends are closed."""
        loop = asyncio.get_running_loop()
        loop.remove_reader(self.read_end)
        self.ended_at = loop.time()
        self._ended.set()

    async def ended(self, within_s: float) -> None:
        """Wait until all write ends are closed, at most ``within_s`` seconds."""
        # Not wait_for: up to Python 3.11 it swallows a cancellation that comes as it completes.
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(within_s):
                await self._ended.wait()


@contextmanager
def open_startup_pipe() -> Iterator[StartupPipe]:
    """Open a pipe; the context watches and closes the read end, the caller closes the write end."""
    read_end, write_end = os.pipe()
    pipe, loop = StartupPipe(read_end, write_end), asyncio.get_running_loop()
    loop.add_reader(read_end, pipe.end)
    try:
        yield pipe
    finally:
        loop.remove_reader(read_end)
        os.close(read_end)
