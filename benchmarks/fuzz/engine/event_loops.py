"""Event loops. One waits for nobody: where nothing is ready, its clock is put forward to what comes next.

A reader that waits two seconds before it gives somebody up is seen to do so at once, over real sockets, and
as it would on any machine however busy. What threads do is waited for as ever, and what child processes do
for a while. The other loop has no threads.
"""

from __future__ import annotations

import asyncio
import selectors
import socket
import struct
from collections.abc import Callable
from typing import Any

_AWHILE_S = 1.0
_AT_ONCE = struct.pack("ii", 1, 0)


class _TimeSkippingSelector(selectors.DefaultSelector):
    """A selector that skips the waiting: timeouts pass at once, without wall-clock time."""

    def __init__(self) -> None:
        super().__init__()
        self.skipped = 0.0
        self.threads = 0
        """That are at work: they are waited for."""
        self.processes = 0
        """That have not ended: they are waited for a while, since they may have nothing to do."""

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Return what is ready now; where nothing is, the time until something is due has passed.

        What is sent on this machine is there when it was sent.
        """
        ready = super().select(0)
        if ready or timeout == 0:
            return ready
        if timeout is None or self.threads:
            return super().select(timeout)
        if self.processes and (ready := super().select(min(timeout, _AWHILE_S))):
            return ready
        self.skipped += timeout
        return []


class TimeSkippingLoop(asyncio.SelectorEventLoop):
    """``time()`` is the only clock that goes with it."""

    def __init__(self) -> None:
        self._impatient = _TimeSkippingSelector()
        super().__init__(self._impatient)

    def time(self) -> float:
        """Return the time, seconds from anywhere, with what was skipped."""
        return super().time() + self._impatient.skipped

    def pass_by(self, seconds: float) -> None:
        """Let time pass."""
        self._impatient.skipped += seconds

    def run_in_executor(  # type: ignore[override]  # whatever it takes
        self, executor: Any, func: Callable[..., Any], *args: Any
    ) -> asyncio.Future[Any]:
        """Do something in a thread, which is waited for."""
        future = super().run_in_executor(executor, func, *args)
        self._impatient.threads += 1
        future.add_done_callback(self._thread_done)
        return future

    async def subprocess_exec(self, *args: Any, **kwargs: Any) -> Any:
        """Start a process."""
        transport, protocol = await super().subprocess_exec(*args, **kwargs)
        started: Any = transport
        self._impatient.processes += 1
        asyncio.ensure_future(started._wait(), loop=self).add_done_callback(self._process_done)
        return transport, protocol

    def _thread_done(self, _: object) -> None:
        self._impatient.threads -= 1

    def _process_done(self, _: object) -> None:
        self._impatient.processes -= 1


class InlineExecutorLoop(asyncio.SelectorEventLoop):
    """Does what is meant for a thread at once, and waits for it."""

    def run_in_executor(  # type: ignore[override]  # whatever it takes
        self, _: Any, func: Callable[..., Any], *args: Any
    ) -> asyncio.Future[Any]:
        """Do something; give a future that has it."""
        future = self.create_future()
        try:
            future.set_result(func(*args))
        except Exception as error:  # noqa: BLE001 — whoever waits for it gets it
            future.set_exception(error)
        return future


def leaves_no_trace(connection: socket.socket) -> None:
    """Have a connection end at once when it is closed: a million of them would use up all ports."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE)
