"""An event loop that waits for nobody: where nothing is ready, its clock is put forward to what comes next.

A reader that waits two seconds before it gives somebody up is seen to do so at once, over real sockets,
and as it would on any machine however busy. What threads and child processes do is waited for as ever.
"""

from __future__ import annotations

import asyncio
import selectors
import socket
import struct
from collections.abc import Callable
from typing import Any

_AT_ONCE = struct.pack("ii", 1, 0)


class _Impatient(selectors.DefaultSelector):
    """Tells the loop what it did not wait for."""

    def __init__(self) -> None:
        super().__init__()
        self.skipped = 0.0
        self.others = 0
        """Threads and processes that are at work."""

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Give what is ready now; where nothing is, the time until something is due has passed.

        What is sent on this machine is there when it was sent.
        """
        ready = super().select(0)
        if ready or timeout == 0:
            return ready
        if timeout is None or self.others:
            return super().select(timeout)
        self.skipped += timeout
        return []


class HurryingLoop(asyncio.SelectorEventLoop):
    """``time()`` is the only clock that goes with it."""

    def __init__(self) -> None:
        self._impatient = _Impatient()
        super().__init__(self._impatient)

    def time(self) -> float:
        """Give the time, seconds from anywhere, with what was skipped."""
        return super().time() + self._impatient.skipped

    def pass_by(self, seconds: float) -> None:
        """Let time pass."""
        self._impatient.skipped += seconds

    def run_in_executor(  # type: ignore[override]  # whatever it takes
        self, executor: Any, func: Callable[..., Any], *args: Any
    ) -> asyncio.Future[Any]:
        """Do something in a thread, which is waited for."""
        future = super().run_in_executor(executor, func, *args)
        self._wait_for(future)
        return future

    async def subprocess_exec(self, *args: Any, **kwargs: Any) -> Any:
        """Start a process, which is waited for until it has ended."""
        transport, protocol = await super().subprocess_exec(*args, **kwargs)
        ended: Any = transport
        self._wait_for(asyncio.ensure_future(ended._wait(), loop=self))
        return transport, protocol

    def _wait_for(self, future: asyncio.Future[Any]) -> None:
        self._impatient.others += 1
        future.add_done_callback(self._done)

    def _done(self, _: object) -> None:
        self._impatient.others -= 1


def leaves_no_trace(writer: asyncio.StreamWriter) -> None:
    """Have a connection end at once when it is closed: a million of them would use up all ports."""
    writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE)
