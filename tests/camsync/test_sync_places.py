"""Limits on connections: a client with many connections takes no place of another."""

from __future__ import annotations

import asyncio
import logging
import socket

import pytest

from camsync import ClientSettings, Credentials, PulseClient, PulseServer, ServerLimits, query_clients
from camsync.limits import select_evicted
from camsync.messages import ClientList, ClientsRequest, Greeting, LoginMessage, LoginRequest, Pong
from camsync.protocol import encode
from fakes.camsync.pulse_clients import Connect, RawConnection
from fakes.timeouts import PATIENCE

FPS = 400.0
LOCALHOST = "127.0.0.1"
USERS = {"c0": "zero" * 16, "c1": "one!" * 16, "bestview": "best" * 16}
PATIENT = ClientSettings(backoff_first=0.01, backoff_most=0.05, queue=100_000, catch_up=PATIENCE)
MANY = 300
"""More connections than a server has places."""


async def log_in(connect: Connect, port: int, user: str, *, hello: bool = False) -> RawConnection:
    """Log in, and wait for the greeting."""
    client = await connect(port)
    assert isinstance(await client.message(), LoginRequest)
    client.send(encode(LoginMessage(user, USERS[user])) + (f"HELLO 1 {user}\n".encode() if hello else b""))
    assert isinstance(await client.message(), Greeting)
    return client


async def receive_pulses(port: int, name: str, credentials: Credentials | None = None) -> None:
    """Connect a client and receive three pulses."""
    async with (
        asyncio.timeout(PATIENCE),
        PulseClient(LOCALHOST, port, name, settings=PATIENT, credentials=credentials) as client,
    ):
        for _ in range(3):
            await anext(client)
        assert client.status().connected


def names(server: PulseServer) -> list[str | None]:
    return [client.name for client in server.clients()]


async def test_repeated_logins_of_one_user_lock_no_other_user_out(connect: Connect) -> None:
    limits = ServerLimits(clients=16, login_places=3, catch_up=PATIENCE)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        for _ in range(40):
            await log_in(connect, server.port, "c0")
        assert len(server.clients()) == 3
        for user, password in USERS.items():
            await receive_pulses(server.port, user, Credentials(user, password))


async def test_a_user_with_more_connections_than_places_locks_no_other_user_out(
    connect: Connect,
) -> None:
    """With the default limits."""
    async with PulseServer(FPS, users=USERS) as server:
        for _ in range(MANY):
            await log_in(connect, server.port, "c0")
        await receive_pulses(server.port, "c1", Credentials("c1", USERS["c1"]))
        assert len(server.clients()) < 20


async def test_a_client_keeps_its_place_when_its_user_connects_again(connect: Connect) -> None:
    limits = ServerLimits(login_places=2, catch_up=PATIENCE)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        client = await log_in(connect, server.port, "c0", hello=True)
        crowd = [await log_in(connect, server.port, "c0") for _ in range(5)]
        for evicted in crowd[:3]:
            assert b"ERROR full " in await evicted.read_to_end(), "the oldest are evicted"
        assert names(server) == ["c0", None, None]
        client.send(b"PING 1\n")
        while not isinstance(await client.message(), Pong):
            pass
        others = await query_clients(
            LOCALHOST, server.port, PATIENCE, credentials=Credentials("c0", USERS["c0"])
        )
        assert others[0].name == "c0"


async def test_a_client_that_is_behind_gets_the_list_once_it_has_read_its_pulses(connect: Connect) -> None:
    async with PulseServer(FPS, limits=ServerLimits(cut_off=PATIENCE)) as server:
        client, other = await connect(server.port, receive=1024), await connect(server.port)
        while not server.clients()[0].dropped:
            await other.pulse()
        client.send(encode(ClientsRequest()))
        while server.clients()[0].dropped < 100:
            await other.pulse()
        message = await client.message()
        while not isinstance(message, ClientList):
            message = await client.message()
        assert len(message.clients) == 1


async def test_a_second_client_of_a_user_replaces_the_first(connect: Connect) -> None:
    async with PulseServer(FPS, users=USERS) as server:
        older = await log_in(connect, server.port, "c0", hello=True)
        await log_in(connect, server.port, "c0", hello=True)
        assert b"ERROR replaced another c0 has connected" in await older.read_to_end()
        assert names(server).count("c0") == 1


async def test_a_place_is_kept_for_every_user_with_any_number_of_other_connections(connect: Connect) -> None:
    limits = ServerLimits(clients=2, login_places=1, catch_up=PATIENCE)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        for user in USERS:
            await log_in(connect, server.port, user, hello=True)
        for user in USERS:
            await log_in(connect, server.port, user)
        assert sorted(name for name in names(server) if name) == sorted(USERS)


async def test_at_an_open_server_a_crowd_from_one_address_locks_no_expected_name_out(
    connect: Connect,
) -> None:
    limits = ServerLimits(clients=4, catch_up=PATIENCE)
    expect = ("c0", "c1")
    async with PulseServer(FPS, expect=expect, start_timeout=0.0, limits=limits) as server:
        (await connect(server.port)).send(b"HELLO 1 c0\n")
        for number in range(20):
            crowd = await connect(server.port)
            crowd.send(f"HELLO 1 x{number}\n".encode() if number % 2 else b"")
            assert isinstance(await crowd.message(), Greeting)
        await receive_pulses(server.port, "c1")
        assert names(server)[0] == "c0"
        assert len(server.clients()) <= 6


async def test_an_evicted_client_that_is_behind_reads_why(connect: Connect) -> None:
    loop, received = asyncio.get_running_loop(), b""
    async with PulseServer(FPS, limits=ServerLimits(clients=1, cut_off=PATIENCE)) as server:
        with socket.socket() as behind:
            behind.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
            behind.setblocking(False)  # noqa: FBT003
            async with asyncio.timeout(PATIENCE):
                await loop.sock_connect(behind, (LOCALHOST, server.port))
                while not any(client.dropped for client in server.clients()):  # noqa: ASYNC110
                    await asyncio.sleep(0.01)
                await connect(server.port)
                while part := await loop.sock_recv(behind, 1 << 16):
                    received += part
    assert received.splitlines()[-1].startswith(b"ERROR full ")


async def test_at_an_open_server_the_oldest_of_the_address_with_most_is_evicted(connect: Connect) -> None:
    limits = ServerLimits(clients=2)
    async with PulseServer(FPS, limits=limits) as server:
        first, second = await connect(server.port), await connect(server.port)
        await first.pulse()
        await second.pulse()
        third = await connect(server.port)
        assert b"ERROR full " in await first.read_to_end()
        await second.pulse()
        await third.pulse()


@pytest.fixture
def other_address() -> str:
    """Another address of this machine."""
    with socket.socket() as probe:
        try:
            probe.bind(("127.0.0.2", 0))
        except OSError:
            pytest.skip("this machine has only one address")
    return "127.0.0.2"


async def test_many_connections_take_no_place_of_another_address(
    connect: Connect, other_address: str
) -> None:
    async with PulseServer(FPS, limits=ServerLimits(clients=3)) as server:
        alone = await connect(server.port, source=other_address)
        for _ in range(10):
            assert isinstance(await (await connect(server.port)).message(), Greeting)
        assert server.clients()[0].address.startswith(other_address)
        await alone.pulse()


async def test_many_pending_logins_evict_none_of_another_address(
    connect: Connect, other_address: str
) -> None:
    limits = ServerLimits(pending_logins=3, login_within=1000.0)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        slow = await connect(server.port, source=other_address)
        assert isinstance(await slow.message(), LoginRequest)
        for _ in range(10):
            assert isinstance(await (await connect(server.port)).message(), LoginRequest)
        slow.send(encode(LoginMessage("c0", USERS["c0"])))
        assert isinstance(await slow.message(), Greeting)


class StubConnection:
    """A connection that has only a user."""

    def __init__(self, user: str) -> None:
        self.user_or_host = user


def test_the_oldest_of_the_busiest_user_is_evicted() -> None:
    connections = [StubConnection(user) for user in "abbcbaa"]
    assert select_evicted(connections) is connections[0]
    assert select_evicted(connections[:-1]) is connections[1]
    assert select_evicted(connections[3:4]) is connections[3]


async def test_clients_that_replace_each_other_are_few_log_lines(
    connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "camsync")
    async with PulseServer(FPS, users=USERS) as server:
        for _ in range(30):
            await log_in(connect, server.port, "c0", hello=True)
        while names(server).count("c0") != 1 or len(names(server)) != 1:  # noqa: ASYNC110
            await asyncio.sleep(0.01)
    assert len(caplog.messages) == 2
    assert caplog.messages[0] == "c0 connected"
    assert caplog.messages[1].startswith("another c0 connected from 127.0.0.1:")


async def test_every_arrival_of_an_expected_name_is_a_log_line(
    connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "camsync")
    names = [f"c{number}" for number in range(12)]
    async with PulseServer(FPS, expect=names, start_timeout=1000.0) as server:
        for name in names:
            (await connect(server.port)).send(f"HELLO 1 {name}\n".encode())
        await server.wait_scheduled()
    assert sorted(caplog.messages) == sorted(f"{name} connected" for name in names)


async def test_unexpected_names_are_few_log_lines(connect: Connect, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "camsync")
    async with PulseServer(FPS, expect=["c0"], start_timeout=0.0) as server:
        for number in range(40):
            stranger = await connect(server.port)
            stranger.send(f"HELLO 1 x{number}\nPING 1\n".encode())
            while not isinstance(await stranger.message(), Pong):
                pass
    assert sum(message.endswith(" connected") for message in caplog.messages) == 8
