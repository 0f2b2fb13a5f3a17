"""Querying a pulse server for its clients."""

from __future__ import annotations

import asyncio
import socket
from contextlib import suppress

import pytest

from camsync import ListedClient, PulseServer, SyncError, query_clients
from camsync.messages import ClientList, Greeting, Pong
from camsync.protocol import MAX_SERVER_LINE, encode, parse_server_line
from fakes.camsync.pulse_clients import Connect
from fakes.timeouts import PATIENCE

FPS = 50.0


async def test_all_other_clients_are_listed_in_the_order_of_joining(connect: Connect) -> None:
    async with PulseServer(FPS, expect={"c0", "c1"}) as server:
        assert await query_clients("127.0.0.1", server.port) == ()
        for line in (b"HELLO 1 c0\n", b"", b"HELLO 1 bestview\n"):
            client = await connect(server.port)
            assert isinstance(await client.message(), Greeting)
            client.send(line + b"PING 1\n")
            while not isinstance(await client.non_pulse(), Pong):
                pass
        clients = await query_clients("127.0.0.1", server.port)
        assert clients == (ListedClient("c0", 0), ListedClient(None, 0), ListedClient("bestview", 0))


async def test_the_list_of_a_full_server_with_long_names_fits_a_line() -> None:
    clients = ClientList(tuple(ListedClient(f"{place:064d}", 10**6) for place in range(256)))
    line = encode(clients)
    assert len(line) <= MAX_SERVER_LINE
    assert parse_server_line(line[:-1]) == clients


async def test_querying_a_closed_port_is_a_clear_error() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(SyncError, match=f"no pulse server at 127.0.0.1:{port}"):
        await query_clients("127.0.0.1", port)


@pytest.mark.parametrize(
    ("answer", "error"),
    [
        (b"", "does not answer"),
        (b"HTTP/1.1 400 Bad Request\r\n", "is no pulse server"),
        (b"PULSE one\n", "is no pulse server"),
        (b"x" * 100_000 + b"\n", "is no pulse server"),
        (b"MYVIEW-SYNC 7 rate:25\n", "speaks version 7"),
    ],
)
async def test_querying_something_else_is_a_clear_error(answer: bytes, error: str) -> None:
    closed = asyncio.Event()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if answer:
            writer.write(answer)
        with suppress(ConnectionError):
            await reader.read()
        writer.close()
        with suppress(ConnectionError):
            await writer.wait_closed()
        closed.set()

    async with await asyncio.start_server(serve, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        with pytest.raises(SyncError, match=error):
            await query_clients("127.0.0.1", port, timeout_s=0.3 if error == "does not answer" else PATIENCE)
        await closed.wait()
