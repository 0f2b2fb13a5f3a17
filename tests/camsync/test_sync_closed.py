"""A closed pulse server: who does not know a password learns nothing and changes nothing."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from itertools import pairwise

import pytest

from camsync import (
    ClientSettings,
    Listener,
    Login,
    Pulse,
    PulseClient,
    PulseServer,
    ServerLimits,
    SyncError,
    VersionError,
    clients_of,
)
from camsync.messages import Challenge, Greeting, Refusal
from camsync.proof import Proof
from camsync.protocol import parse_server_line
from fakes.pulses import ByHand, Connect
from fakes.timeouts import PATIENCE

FPS = 400.0
USERS = {"c0": "zero" * 16, "c1": "one!" * 16, "bestview": "best" * 16}
PATIENT = ClientSettings(backoff_first=0.01, backoff_most=0.05, queue=100_000, catch_up=PATIENCE)
"""Loses nothing, however busy the machine is."""
HERE = "127.0.0.1"
C0 = Login("c0", USERS["c0"])


async def until(server: PulseServer, refused: int) -> None:
    while server.refused < refused:  # noqa: ASYNC110 — nothing tells of it
        await asyncio.sleep(0.01)


async def login_by_hand(stranger: ByHand, user: str, password: str) -> Proof:
    """Do what a client does, by hand: prove who it is."""
    proof = Proof(Login(user, password))
    stranger.say(proof.proven(await stranger.message()))
    return proof


async def take(client: PulseClient, count: int) -> list[Pulse]:
    async with asyncio.timeout(PATIENCE):
        return [await anext(client) for _ in range(count)]


async def test_who_knows_a_password_gets_every_pulse_and_may_ask_who_is_there() -> None:
    limits = ServerLimits(catch_up=PATIENCE)
    async with PulseServer(FPS, expect={"c0"}, start_timeout=1000.0, users=USERS, limits=limits) as server:
        async with PulseClient(HERE, server.port, "c0", settings=PATIENT, login=C0) as client:
            pulses = await take(client, 30)
            assert [it.number for it in pulses] == list(range(30))
            assert client.status().connected
            login = Login("bestview", USERS["bestview"])
            assert await clients_of(HERE, server.port, PATIENCE, login) == (Listener("c0", 0),)
        assert server.refused == 0


STRANGE = (
    b"HELLO 1 c0\n",
    b"HELLO 1 c0 last=1000 ago=0\n",
    b"WHO\n",
    b"PING 1\n",
    b"\n",
    b"PROVE c0\n",
    b"PROVE c0 nonce=" + b"0" * 32 + b"\n",
    b"PROVE c0 nonce=" + b"0" * 32 + b" mac=" + b"0" * 32 + b"\n",
    b"PROVE nobody nonce=" + b"0" * 32 + b" mac=" + b"0" * 32 + b"\n",
    b"\x16\x03\x01\x02\x00\x01\n",
    b"GET / HTTP/1.1\r\n\r\n",
    b"x" * 300,
)


@pytest.mark.parametrize("said", STRANGE)
async def test_a_stranger_is_told_nothing_and_changes_nothing(by_hand: Connect, said: bytes) -> None:
    async with PulseServer(FPS, expect={"c0"}, start_timeout=1000.0, users=USERS) as server:
        stranger = await by_hand(server.port)
        assert isinstance(await stranger.message(), Challenge)
        stranger.say(said + b"HELLO 1 c0\nWHO\n")
        lines = (await stranger.ended()).splitlines()
        assert len(lines) <= 1
        assert all(isinstance(parse_server_line(it), Refusal) for it in lines)
        assert (server.clients(), server.missing(), server.pulse) == ((), ("c0",), None)


async def test_a_wrong_password_is_told_as_a_wrong_name_is(by_hand: Connect) -> None:
    async with PulseServer(FPS, users=USERS) as server:
        told = set()
        for user, password in (("c0", USERS["c1"]), ("nobody", USERS["c0"]), ("c0", "")):
            stranger = await by_hand(server.port)
            await login_by_hand(stranger, user, password)
            told.add(await stranger.ended())
        assert told == {b"ERROR closed there is no such user, or the password is another\n"}
        assert server.refused == 3


async def test_who_says_nothing_is_sent_away(by_hand: Connect) -> None:
    async with PulseServer(FPS, users=USERS, limits=ServerLimits(prove_within=0.05)) as server:
        stranger = await by_hand(server.port)
        assert isinstance(await stranger.message(), Challenge)
        assert await stranger.ended() == b"ERROR closed no proof has come\n"


async def test_no_user_speaks_for_another(by_hand: Connect) -> None:
    async with PulseServer(FPS, expect={"c0"}, start_timeout=1000.0, users=USERS) as server:
        other = await by_hand(server.port)
        proof = await login_by_hand(other, "c1", USERS["c1"])
        other.say(proof.sealed(b"HELLO 1 c0\n"))
        lines = [proof.opened((await other.line()).rstrip()) for _ in range(3)]
        assert isinstance(parse_server_line(lines[0]), Greeting)
        assert lines[1:] == [b"WAIT c0", b"ERROR name this connection is for c1 alone"]
        assert server.missing() == ("c0",)


async def test_what_another_connection_said_opens_nothing(by_hand: Connect) -> None:
    """Overheard lines, sent again: the server's nonce is another."""
    async with PulseServer(FPS, expect={"c1"}, start_timeout=1000.0, users=USERS) as server:
        first, again = await by_hand(server.port), await by_hand(server.port)
        proof = Proof(C0)
        said = proof.proven(await first.message()) + proof.sealed(b"HELLO 1 c0 last=1000 ago=0\n")
        assert isinstance(await again.message(), Challenge)
        again.say(said)
        assert (await again.ended()).startswith(b"ERROR closed ")
        assert server.clients() == ()


async def test_strangers_in_masses_keep_nobody_out(by_hand: Connect) -> None:
    limits = ServerLimits(strangers=4, clients=2, catch_up=PATIENCE)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        crowd = [await by_hand(server.port) for _ in range(50)]
        async with PulseClient(HERE, server.port, "c0", settings=PATIENT, login=C0) as client:
            numbers = [it.number for it in await take(client, 20)]
            crowd += [await by_hand(server.port) for _ in range(50)]
            numbers += [it.number for it in await take(client, 20)]
            await until(server, 96)
            assert [info.name for info in server.clients()] == ["c0"]
            assert client.status().connections == 1
        assert all(later == earlier + 1 for earlier, later in pairwise(numbers))


async def test_strangers_in_masses_are_one_line_of_the_log(
    by_hand: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    async with PulseServer(FPS, users=USERS) as server:
        for _ in range(20):
            (await by_hand(server.port)).say(b"HELLO 1 c0\n")
        await until(server, 20)
    assert [it.levelname for it in caplog.records] == ["WARNING"]
    assert "is not let in (1 so far): who comes to this server has to prove" in caplog.text


async def test_a_server_that_stops_tells_who_waits_at_its_door(by_hand: Connect) -> None:
    server = PulseServer(FPS, users=USERS)
    await server.start()
    stranger = await by_hand(server.port)
    assert isinstance(await stranger.message(), Challenge)
    await server.stop()
    assert await stranger.ended() == b"ERROR stopped the server stops\n"


async def test_a_client_without_a_password_ends_with_one_clear_line() -> None:
    async with PulseServer(FPS, users=USERS) as server, PulseClient(HERE, server.port, "c0") as client:
        with pytest.raises(VersionError, match=r"^the pulse server asks for a password, and this client has"):
            await take(client, 1)
        with pytest.raises(SyncError, match=r"asks for a password$"):
            await clients_of(HERE, server.port)


@pytest.mark.parametrize(
    ("users", "why"),
    [(None, "it asks for no password, so it may be anybody"), ({"c0": "another"}, "it refuses: there is no")],
)
async def test_a_client_with_a_password_follows_nobody_who_does_not_know_it(
    users: dict[str, str] | None, why: str, caplog: pytest.LogCaptureFixture
) -> None:
    settings = ClientSettings(backoff_first=0.01, backoff_most=0.01, free_run_after=0.2)
    caplog.set_level(logging.WARNING, "camsync.client")
    async with PulseServer(FPS, users=users) as server:
        client = PulseClient(HERE, server.port, "c0", settings=settings, login=C0)
        async with client:
            pulses = await take(client, 3)
            assert all(it.own for it in pulses), "it counts by itself"
            assert client.status().connections == 0
        with pytest.raises(SyncError, match=why):
            await clients_of(HERE, server.port, PATIENCE, C0)
    told = [it.getMessage() for it in caplog.records if it.name == "camsync.client"]
    assert len(told) == 1, "an absence is one line"
    assert why in told[0]


@asynccontextmanager
async def in_between(port: int, changed: Callable[[int, bytes], bytes]) -> AsyncIterator[int]:
    """Sit between clients and a server, and change what the server says: line by line, from 0."""

    async def pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while data := await reader.read(4096):
                writer.write(data)
        finally:
            writer.close()

    async def sit(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        theirs, to_server = await asyncio.open_connection(HERE, port)
        asking = asyncio.create_task(pass_on(reader, to_server))
        number = 0
        try:
            while line := await theirs.readline():
                writer.write(changed(number, line))
                number += 1
        finally:
            asking.cancel()
            await asyncio.gather(asking, return_exceptions=True)
            to_server.close()
            writer.close()

    async with await asyncio.start_server(sit, HERE, 0) as server:
        yield server.sockets[0].getsockname()[1]


@pytest.mark.parametrize("way", ["changed", "doubled", "left out"])
async def test_who_sits_in_between_misleads_nobody(way: str, caplog: pytest.LogCaptureFixture) -> None:
    """One pulse after the 20th line: the client then follows nobody, counts by itself, and comes anew."""
    caplog.set_level(logging.WARNING, "camsync.client")
    misled: list[bytes] = []

    def misleading(number: int, line: bytes) -> bytes:
        if misled or number < 20 or not line.startswith(b"PULSE "):
            return line
        misled.append(line)
        ways = {"changed": line.replace(b"PULSE ", b"PULSE 9", 1), "doubled": line + line, "left out": b""}
        return ways[way]

    limits = ServerLimits(catch_up=PATIENCE)
    async with (
        PulseServer(FPS, users=USERS, limits=limits) as server,
        in_between(server.port, misleading) as port,
        PulseClient(HERE, port, "c0", settings=PATIENT, login=C0) as client,
    ):
        numbers = [it.number for it in await take(client, 100)]
        while client.status().connections < 2:
            numbers += [it.number for it in await take(client, 1)]
    assert all(later == earlier + 1 for earlier, later in pairwise(numbers))
    assert "what it says is not sealed by the password" in caplog.text
