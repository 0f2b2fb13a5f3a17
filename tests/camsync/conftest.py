"""Fixtures of the pulse tests."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack

import pytest

from fakes.camsync.pulse_clients import ByHand, Connect, JumpingClock


async def _close(writer: asyncio.StreamWriter) -> None:
    writer.transport.abort()
    await asyncio.gather(writer.wait_closed(), return_exceptions=True)


@pytest.fixture
async def by_hand() -> AsyncIterator[Connect]:
    """Yield a function that connects to a port.

    It takes ``receive`` bytes of kernel buffer, and ``source``, the address to come from, where given.
    """
    async with AsyncExitStack() as stack:

        async def connect(port: int, receive: int | None = None, source: str | None = None) -> ByHand:
            connection = socket.socket()
            if source is not None:
                connection.bind((source, 0))
            if receive is not None:
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive)
            connection.settimeout(0.0)
            await asyncio.get_running_loop().sock_connect(connection, ("127.0.0.1", port))
            reader, writer = await asyncio.open_connection(sock=connection, limit=4096)
            stack.push_async_callback(_close, writer)
            return ByHand(reader, writer)

        yield connect


@pytest.fixture
def jumping_clock() -> JumpingClock:
    return JumpingClock()
