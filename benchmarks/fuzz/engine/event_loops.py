"""Event loops for fuzzing: one skips waiting times, one has no threads.

The first advances its clock to the next timeout when nothing is ready, so that timeouts pass immediately,
even with real sockets and on a busy machine. It waits normally for threads, and briefly for child processes.
"""

from __future__ import annotations

import asyncio
import selectors
import socket
import struct
from collections.abc import Callable
from typing import Any

_PROCESS_WAIT_S = 1.0
_AT_ONCE = struct.pack("ii", 1, 0)


class _TimeSkippingSelector(selectors.DefaultSelector):
    """A selector that skips waiting times: timeouts pass without wall-clock time."""

    def __init__(self) -> None:
        super().__init__()
        self.skipped = 0.0
        self.threads = 0
        """Number of running threads, for which the selector waits."""
        self.processes = 0
        """Number of running child processes, for which it waits briefly, since they may be idle."""

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Return what is ready now; if nothing is, skip the timeout.

        Local data are readable as soon as they are sent.
        """
        ready = super().select(0)
        if ready or timeout == 0:
            return ready
        if timeout is None or self.threads:
            return super().select(timeout)
        if self.processes and (ready := super().select(min(timeout, _PROCESS_WAIT_S))):
            return ready
        self.skipped += timeout
        return []


class TimeSkippingLoop(asyncio.SelectorEventLoop):
    """An event loop that skips waiting times; only its ``time()`` includes them."""

    def __init__(self) -> None:
        self._skipping_selector = _TimeSkippingSelector()
        super().__init__(self._skipping_selector)

    def time(self) -> float:
        """Return the monotonic time including the skipped time."""
        return super().time() + self._skipping_selector.skipped

    def skip(self, seconds: float) -> None:
        """Skip some seconds."""
        self._skipping_selector.skipped += seconds

    def run_in_executor(  # type: ignore[override]  # any arguments
        self, executor: Any, func: Callable[..., Any], *args: Any
    ) -> asyncio.Future[Any]:
        """Run a function in a thread, for which the loop waits."""
        future = super().run_in_executor(executor, func, *args)
        self._skipping_selector.threads += 1
        future.add_done_callback(self._thread_done)
        return future

    async def subprocess_exec(self, *args: Any, **kwargs: Any) -> Any:
        """Start a process."""
        transport, protocol = await super().subprocess_exec(*args, **kwargs)
        started: Any = transport
        self._skipping_selector.processes += 1
        asyncio.ensure_future(started._wait(), loop=self).add_done_callback(self._process_done)
        return transport, protocol

    def _thread_done(self, _: object) -> None:
        self._skipping_selector.threads -= 1

    def _process_done(self, _: object) -> None:
        self._skipping_selector.processes -= 1


class InlineExecutorLoop(asyncio.SelectorEventLoop):
    """An event loop that runs executor functions synchronously."""

    def run_in_executor(  # type: ignore[override]  # any arguments
        self, _: Any, func: Callable[..., Any], *args: Any
    ) -> asyncio.Future[Any]:
        """Run a function; return a future with its result."""
        future = self.create_future()
        try:
            future.set_result(func(*args))
        except Exception as error:  # noqa: BLE001 — passed on to the caller
            future.set_exception(error)
        return future


def skip_time_wait(connection: socket.socket) -> None:
    """Let a connection skip TIME_WAIT when closed: a million of them would use up the ports."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE)
