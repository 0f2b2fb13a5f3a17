"""Places at the pulse server: who holds very many takes none of anybody else's."""

from __future__ import annotations

import asyncio
import logging
import socket

import pytest

from camsync import ClientSettings, Login, PulseClient, PulseServer, ServerLimits, clients_of
from camsync.client_eviction import who_makes_room
from camsync.messages import Challenge, Greeting, Pong
from camsync.proof import Proof
from camsync.protocol import parse_server_line
from fakes.pulses import ByHand, Connect
from fakes.timeouts import PATIENCE

FPS = 400.0
HERE = "127.0.0.1"
USERS = {"c0": "zero" * 16, "c1": "one!" * 16, "bestview": "best" * 16}
PATIENT = ClientSettings(backoff_first=0.01, backoff_most=0.05, queue=100_000, catch_up=PATIENCE)
MANY = 300
"""More connections than a server has places."""


async def proven(connect: Connect, port: int, user: str, *, hello: bool = False) -> tuple[ByHand, Proof]:
    """Come as a user, by hand, and wait until the server has let them in."""
    client = await connect(port)
    proof = Proof(Login(user, USERS[user]))
    client.say(proof.proven(await client.message()))
    if hello:
        client.say(proof.sealed(f"HELLO 1 {user}\n".encode()))
    greeting = parse_server_line(proof.opened((await client.line()).rstrip()))
    assert isinstance(greeting, Greeting)
    return client, proof


async def first_pulses(port: int, name: str, login: Login | None = None) -> None:
    """Come as somebody who follows pulses, and get some."""
    async with asyncio.timeout(PATIENCE), PulseClient(HERE, port, name, settings=PATIENT, login=login) as it:
        for _ in range(3):
            await anext(it)
        assert it.status().connected


def named(server: PulseServer) -> list[str | None]:
    return [it.name for it in server.clients()]


async def test_one_login_that_comes_again_and_again_keeps_nobody_else_out(by_hand: Connect) -> None:
    limits = ServerLimits(clients=16, login_places=3, catch_up=PATIENCE)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        for _ in range(40):
            await proven(by_hand, server.port, "c0")
        assert len(server.clients()) == 3
        for user, password in USERS.items():
            await first_pulses(server.port, user, Login(user, password))


async def test_one_login_with_more_connections_than_there_are_places_keeps_nobody_out(
    by_hand: Connect,
) -> None:
    """By what a server has unless it is told otherwise."""
    async with PulseServer(FPS, users=USERS) as server:
        for _ in range(MANY):
            await proven(by_hand, server.port, "c0")
        await first_pulses(server.port, "c1", Login("c1", USERS["c1"]))
        assert len(server.clients()) < 20


async def test_who_follows_under_a_login_stays_when_it_comes_again_to_ask(by_hand: Connect) -> None:
    limits = ServerLimits(login_places=2, catch_up=PATIENCE)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        follows, proof = await proven(by_hand, server.port, "c0", hello=True)
        crowd = [(await proven(by_hand, server.port, "c0"))[0] for _ in range(5)]
        for it in crowd[:3]:
            assert b"ERROR full " in await it.ended(), "the oldest make room"
        assert named(server) == ["c0", None, None]
        follows.say(proof.sealed(b"PING 1\n"))
        while not isinstance(parse_server_line(proof.opened((await follows.line()).rstrip())), Pong):
            pass
        others = await clients_of(HERE, server.port, PATIENCE, Login("c0", USERS["c0"]))
        assert others[0].name == "c0"


async def test_a_second_of_a_login_that_follows_takes_the_place_of_the_first(by_hand: Connect) -> None:
    async with PulseServer(FPS, users=USERS) as server:
        older, _ = await proven(by_hand, server.port, "c0", hello=True)
        await proven(by_hand, server.port, "c0", hello=True)
        assert b"ERROR replaced another c0 has come" in await older.ended()
        assert named(server).count("c0") == 1


async def test_a_place_is_kept_for_every_user_however_many_others_there_are(by_hand: Connect) -> None:
    limits = ServerLimits(clients=2, login_places=1, catch_up=PATIENCE)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        for user in USERS:
            await proven(by_hand, server.port, user, hello=True)
        for user in USERS:
            await proven(by_hand, server.port, user)
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


async def test_strangers_in_masses_take_no_place_at_the_door_of_another_address(
    by_hand: Connect, elsewhere: str
) -> None:
    limits = ServerLimits(strangers=3, prove_within=1000.0)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        slow = await by_hand(server.port, source=elsewhere)
        challenge = await slow.message()
        for _ in range(10):
            assert isinstance(await (await by_hand(server.port)).message(), Challenge)
        proof = Proof(Login("c0", USERS["c0"]))
        slow.say(proof.proven(challenge))
        assert isinstance(parse_server_line(proof.opened((await slow.line()).rstrip())), Greeting)


class Somebody:
    """A connection, as far as places go."""

    def __init__(self, origin: str) -> None:
        self.origin = origin


def test_who_makes_room_is_the_oldest_of_those_who_have_most() -> None:
    there = [Somebody(it) for it in "abbcbaa"]
    assert who_makes_room(there) is there[0]
    assert who_makes_room(there[:-1]) is there[1]
    assert who_makes_room(there[3:4]) is there[3]


async def test_two_of_one_name_that_replace_each_other_are_few_lines_of_the_log(
    by_hand: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "camsync")
    async with PulseServer(FPS, users=USERS) as server:
        for _ in range(30):
            await proven(by_hand, server.port, "c0", hello=True)
        while named(server).count("c0") != 1 or len(named(server)) != 1:  # noqa: ASYNC110
            await asyncio.sleep(0.01)
    assert len(caplog.messages) == 2
    assert caplog.messages[0] == "c0 is here"
    assert caplog.messages[1].startswith("another c0 is here, from 127.0.0.1:")


async def test_every_expected_name_that_comes_is_a_line_of_the_log(
    by_hand: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "camsync")
    names = [f"c{number}" for number in range(12)]
    async with PulseServer(FPS, expect=names, start_timeout=1000.0) as server:
        for name in names:
            (await by_hand(server.port)).say(f"HELLO 1 {name}\n".encode())
        await server.wait_begun()
    assert sorted(caplog.messages) == sorted(f"{name} is here" for name in names)


async def test_names_that_nobody_expects_are_few_lines_of_the_log(
    by_hand: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "camsync")
    async with PulseServer(FPS, expect=["c0"], start_timeout=0.0) as server:
        for number in range(40):
            stranger = await by_hand(server.port)
            stranger.say(f"HELLO 1 x{number}\nPING 1\n".encode())
            while not isinstance(await stranger.message(), Pong):
                pass
    assert sum(it.endswith(" is here") for it in caplog.messages) == 8
