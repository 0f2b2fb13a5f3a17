"""Fixtures of the pulse tests."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack

import pytest

from fakes.camsync.pulse_clients import Connect, JumpingClock, RawConnection


async def _close(writer: asyncio.StreamWriter) -> None:
    writer.transport.abort()
    await asyncio.gather(writer.wait_closed(), return_exceptions=True)


@pytest.fixture
async def connect() -> AsyncIterator[Connect]:
    """Yield a function that connects to a port.

    Optional: ``receive``, the bytes of the kernel's receive buffer; ``source``, the local address.
    """
    async with AsyncExitStack() as stack:

        async def open_connection(
            port: int, receive: int | None = None, source: str | None = None
        ) -> RawConnection:
            connection = socket.socket()
            if source is not None:
                connection.bind((source, 0))
            if receive is not None:
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive)
            connection.settimeout(0.0)
            await asyncio.get_running_loop().sock_connect(connection, ("127.0.0.1", port))
            reader, writer = await asyncio.open_connection(sock=connection, limit=4096)
            stack.push_async_callback(_close, writer)
            return RawConnection(reader, writer)

        yield open_connection


@pytest.fixture
def jumping_clock() -> JumpingClock:
    return JumpingClock()
