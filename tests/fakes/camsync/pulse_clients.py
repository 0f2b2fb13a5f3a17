"""Raw connections to a pulse server, a clock that jumps, and a fake pulse server."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import ExitStack, asynccontextmanager
from dataclasses import dataclass

from camsync import (
    ClientSettings,
    Pulse,
    PulseClient,
)
from camsync.clock import Clock, steady_unix_clock
from camsync.messages import PulseMessage, ServerLine
from camsync.protocol import parse_server_line
from fakes.timeouts import PATIENCE

CLOCK_TOLERANCE = 0.5
"""Error of clock measurements on a busy machine, in seconds."""


@dataclass
class RawConnection:
    """A bare TCP connection to a pulse server."""

    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter

    async def line(self) -> bytes:
        async with asyncio.timeout(PATIENCE):
            return await self.reader.readline()

    async def message(self) -> ServerLine | None:
        line = await self.line()
        assert line.endswith(b"\n"), f"the server disconnected after {line!r}"
        return parse_server_line(line.removesuffix(b"\n"))

    async def pulse(self) -> PulseMessage:
        while True:
            message = await self.message()
            if isinstance(message, PulseMessage):
                return message

    async def non_pulse(self) -> ServerLine | None:
        """Return the next message that is not a pulse."""
        while True:
            message = await self.message()
            if not isinstance(message, PulseMessage):
                return message

    async def read_to_end(self) -> bytes:
        """Read until the server disconnects; return all bytes."""
        async with asyncio.timeout(PATIENCE):
            try:
                return await self.reader.read(-1)
            except ConnectionError:
                return b""

    def send(self, data: bytes) -> None:
        self.writer.write(data)


class JumpingClock:
    """The steady clock plus ``jumped`` seconds."""

    def __init__(self) -> None:
        self._clock: Clock = steady_unix_clock()
        self.jumped = 0.0

    def __call__(self) -> float:
        return self._clock() + self.jumped


class SteppedClock:
    """A clock that the test sets: ``now``, in seconds."""

    def __init__(self) -> None:
        self.now = 1_000_000.25

    def __call__(self) -> float:
        return self.now


Connect = Callable[..., Awaitable[RawConnection]]


FPS = 400.0
QUICK_SETTINGS = ClientSettings(backoff_first=0.01, backoff_most=0.05, ping_interval=0.05, silence=0.3)


async def next_pulses(client: PulseClient, count: int) -> list[Pulse]:
    async with asyncio.timeout(PATIENCE):
        return [await anext(client) for _ in range(count)]


@asynccontextmanager
async def fake_server(answer: Callable[[], bytes]) -> AsyncIterator[tuple[int, asyncio.Semaphore]]:
    """Send ``answer()`` to every connection; yield the port and a semaphore released once per connection."""
    loop = asyncio.get_running_loop()
    calls = asyncio.Semaphore(0)
    with ExitStack() as stack:
        listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        listener.settimeout(0.0)

        async def serve() -> None:
            while True:
                connection, _ = await loop.sock_accept(listener)
                stack.enter_context(connection)
                connection.sendall(answer())
                calls.release()

        serving = asyncio.create_task(serve())
        yield listener.getsockname()[1], calls
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
