"""Places at the pulse server: who holds very many takes none of anybody else's."""

from __future__ import annotations

import asyncio
import logging
import socket

import pytest

from camsync import ClientSettings, Credentials, PulseClient, PulseServer, ServerLimits, query_clients
from camsync.limits import select_evicted
from camsync.messages import Greeting, LoginMessage, LoginRequest, Pong
from camsync.protocol import encode
from fakes.camsync.pulse_clients import ByHand, Connect
from fakes.timeouts import PATIENCE

FPS = 400.0
HERE = "127.0.0.1"
USERS = {"c0": "zero" * 16, "c1": "one!" * 16, "bestview": "best" * 16}
PATIENT = ClientSettings(backoff_first=0.01, backoff_most=0.05, queue=100_000, catch_up=PATIENCE)
MANY = 300
"""More connections than a server has places."""


async def logged_in(connect: Connect, port: int, user: str, *, hello: bool = False) -> ByHand:
    """Log in by hand, and wait for the greeting."""
    client = await connect(port)
    assert isinstance(await client.message(), LoginRequest)
    client.say(encode(LoginMessage(user, USERS[user])) + (f"HELLO 1 {user}\n".encode() if hello else b""))
    assert isinstance(await client.message(), Greeting)
    return client


async def first_pulses(port: int, name: str, credentials: Credentials | None = None) -> None:
    """Come as somebody who follows pulses, and get some."""
    async with (
        asyncio.timeout(PATIENCE),
        PulseClient(HERE, port, name, settings=PATIENT, credentials=credentials) as it,
    ):
        for _ in range(3):
            await anext(it)
        assert it.status().connected


def named(server: PulseServer) -> list[str | None]:
    return [it.name for it in server.clients()]


async def test_repeated_logins_of_one_user_keep_no_other_out(by_hand: Connect) -> None:
    limits = ServerLimits(clients=16, login_places=3, catch_up=PATIENCE)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        for _ in range(40):
            await logged_in(by_hand, server.port, "c0")
        assert len(server.clients()) == 3
        for user, password in USERS.items():
            await first_pulses(server.port, user, Credentials(user, password))


async def test_a_user_with_more_connections_than_places_keeps_no_other_out(
    by_hand: Connect,
) -> None:
    """By what a server has unless it is told otherwise."""
    async with PulseServer(FPS, users=USERS) as server:
        for _ in range(MANY):
            await logged_in(by_hand, server.port, "c0")
        await first_pulses(server.port, "c1", Credentials("c1", USERS["c1"]))
        assert len(server.clients()) < 20


async def test_a_client_keeps_its_place_when_its_user_connects_again(by_hand: Connect) -> None:
    limits = ServerLimits(login_places=2, catch_up=PATIENCE)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        follows = await logged_in(by_hand, server.port, "c0", hello=True)
        crowd = [await logged_in(by_hand, server.port, "c0") for _ in range(5)]
        for it in crowd[:3]:
            assert b"ERROR full " in await it.ended(), "the oldest make room"
        assert named(server) == ["c0", None, None]
        follows.say(b"PING 1\n")
        while not isinstance(await follows.message(), Pong):
            pass
        others = await query_clients(HERE, server.port, PATIENCE, credentials=Credentials("c0", USERS["c0"]))
        assert others[0].name == "c0"


async def test_a_second_client_of_a_user_replaces_the_first(by_hand: Connect) -> None:
    async with PulseServer(FPS, users=USERS) as server:
        older = await logged_in(by_hand, server.port, "c0", hello=True)
        await logged_in(by_hand, server.port, "c0", hello=True)
        assert b"ERROR replaced another c0 has connected" in await older.ended()
        assert named(server).count("c0") == 1


async def test_a_place_is_kept_for_every_user_however_many_others_there_are(by_hand: Connect) -> None:
    limits = ServerLimits(clients=2, login_places=1, catch_up=PATIENCE)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        for user in USERS:
            await logged_in(by_hand, server.port, user, hello=True)
        for user in USERS:
            await logged_in(by_hand, server.port, user)
        assert sorted(it for it in named(server) if it) == sorted(USERS)


async def test_at_an_open_server_a_crowd_from_one_address_keeps_no_expected_name_out(
    by_hand: Connect,
) -> None:
    limits = ServerLimits(clients=4, catch_up=PATIENCE)
    expect = ("c0", "c1")
    async with PulseServer(FPS, expect=expect, start_timeout=0.0, limits=limits) as server:
        (await by_hand(server.port)).say(b"HELLO 1 c0\n")
        for number in range(20):
            crowd = await by_hand(server.port)
            crowd.say(f"HELLO 1 x{number}\n".encode() if number % 2 else b"")
            assert isinstance(await crowd.message(), Greeting)
        await first_pulses(server.port, "c1")
        assert named(server)[0] == "c0"
        assert len(server.clients()) <= 6


async def test_at_an_open_server_the_oldest_of_the_address_with_most_makes_room(by_hand: Connect) -> None:
    limits = ServerLimits(clients=2)
    async with PulseServer(FPS, limits=limits) as server:
        first, second = await by_hand(server.port), await by_hand(server.port)
        await first.beat()
        await second.beat()
        third = await by_hand(server.port)
        assert b"ERROR full " in await first.ended()
        await second.beat()
        await third.beat()


@pytest.fixture
def elsewhere() -> str:
    """Another address of this machine."""
    with socket.socket() as it:
        try:
            it.bind(("127.0.0.2", 0))
        except OSError:
            pytest.skip("this machine has one address alone")
    return "127.0.0.2"


async def test_a_crowd_takes_no_place_of_another_address(by_hand: Connect, elsewhere: str) -> None:
    async with PulseServer(FPS, limits=ServerLimits(clients=3)) as server:
        alone = await by_hand(server.port, source=elsewhere)
        for _ in range(10):
            assert isinstance(await (await by_hand(server.port)).message(), Greeting)
        assert server.clients()[0].address.startswith(elsewhere)
        await alone.beat()


async def test_very_many_pending_logins_evict_none_of_another_address(
    by_hand: Connect, elsewhere: str
) -> None:
    limits = ServerLimits(pending_logins=3, login_within=1000.0)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        slow = await by_hand(server.port, source=elsewhere)
        assert isinstance(await slow.message(), LoginRequest)
        for _ in range(10):
            assert isinstance(await (await by_hand(server.port)).message(), LoginRequest)
        slow.say(encode(LoginMessage("c0", USERS["c0"])))
        assert isinstance(await slow.message(), Greeting)


class Somebody:
    """A connection, as far as places go."""

    def __init__(self, origin: str) -> None:
        self.origin = origin


def test_the_oldest_of_the_busiest_origin_is_evicted() -> None:
    there = [Somebody(it) for it in "abbcbaa"]
    assert select_evicted(there) is there[0]
    assert select_evicted(there[:-1]) is there[1]
    assert select_evicted(there[3:4]) is there[3]


async def test_clients_that_replace_each_other_are_few_lines_of_the_log(
    by_hand: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "camsync")
    async with PulseServer(FPS, users=USERS) as server:
        for _ in range(30):
            await logged_in(by_hand, server.port, "c0", hello=True)
        while named(server).count("c0") != 1 or len(named(server)) != 1:  # noqa: ASYNC110
            await asyncio.sleep(0.01)
    assert len(caplog.messages) == 2
    assert caplog.messages[0] == "c0 connected"
    assert caplog.messages[1].startswith("another c0 connected from 127.0.0.1:")


async def test_every_arrival_of_an_expected_name_is_a_line_of_the_log(
    by_hand: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "camsync")
    names = [f"c{number}" for number in range(12)]
    async with PulseServer(FPS, expect=names, start_timeout=1000.0) as server:
        for name in names:
            (await by_hand(server.port)).say(f"HELLO 1 {name}\n".encode())
        await server.wait_begun()
    assert sorted(caplog.messages) == sorted(f"{name} connected" for name in names)


async def test_unexpected_names_are_few_lines_of_the_log(
    by_hand: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "camsync")
    async with PulseServer(FPS, expect=["c0"], start_timeout=0.0) as server:
        for number in range(40):
            stranger = await by_hand(server.port)
            stranger.say(f"HELLO 1 x{number}\nPING 1\n".encode())
            while not isinstance(await stranger.message(), Pong):
                pass
    assert sum(it.endswith(" connected") for it in caplog.messages) == 8
