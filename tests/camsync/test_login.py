"""A pulse server with users: a client that has not logged in receives nothing and changes nothing."""

from __future__ import annotations

import asyncio
import logging
import ssl
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest

from camsync import (
    ClientSettings,
    Credentials,
    ListedClient,
    LoginError,
    Pulse,
    PulseClient,
    PulseServer,
    ServerLimits,
    SyncError,
    query_clients,
)
from camsync.messages import ErrorMessage, Greeting, LoginMessage, LoginRequest, Pong
from camsync.protocol import encode, parse_server_line
from fakes.camsync.pulse_clients import Connect, RawConnection
from fakes.programs import needs_openssl
from fakes.timeouts import PATIENCE

FPS = 400.0
USERS = {"c0": "zero" * 16, "c1": "one!" * 16, "bestview": "best" * 16}
PATIENT = ClientSettings(backoff_first=0.01, backoff_most=0.05, queue=100_000, catch_up=PATIENCE)
"""Loses no pulse on a busy machine."""
LOCALHOST = "127.0.0.1"
C0 = Credentials("c0", USERS["c0"])


async def until_refused(server: PulseServer, count: int) -> None:
    while server.refused < count:  # noqa: ASYNC110 — there is no event for it
        await asyncio.sleep(0.01)


async def log_in(connection: RawConnection, user: str, password: str) -> None:
    """Answer the login request."""
    assert isinstance(await connection.message(), LoginRequest)
    connection.send(encode(LoginMessage(user, password)))


async def take(client: PulseClient, count: int) -> list[Pulse]:
    async with asyncio.timeout(PATIENCE):
        return [await anext(client) for _ in range(count)]


async def test_a_client_that_logs_in_gets_every_pulse_and_may_list_the_clients() -> None:
    limits = ServerLimits(catch_up=PATIENCE)
    async with PulseServer(FPS, expect={"c0"}, start_timeout=1000.0, users=USERS, limits=limits) as server:
        async with PulseClient(LOCALHOST, server.port, "c0", settings=PATIENT, credentials=C0) as client:
            pulses = await take(client, 30)
            assert [pulse.number for pulse in pulses] == list(range(30))
            assert client.status().connected
            credentials = Credentials("bestview", USERS["bestview"])
            listed = await query_clients(LOCALHOST, server.port, PATIENCE, credentials=credentials)
            assert listed == (ListedClient("c0", 0),)
        assert server.refused == 0


NO_LOGINS = (
    b"HELLO 1 c0\n",
    b"HELLO 1 c0 last=1000 ago=0\n",
    b"WHO\n",
    b"PING 1\n",
    b"\n",
    b"LOGIN c0\n",
    b"LOGIN c0 \n",
    b"LOGIN c0 " + USERS["c1"].encode() + b"\n",
    b"LOGIN unknown " + USERS["c0"].encode() + b"\n",
    b"LOGIN c0 " + USERS["c0"].encode() + b" and more\n",
    b"LOGIN c0 " + b"0" * 129 + b"\n",
    b"\x16\x03\x01\x02\x00\x01\n",
    b"GET / HTTP/1.1\r\n\r\n",
    b"x" * 300,
)


@pytest.mark.parametrize("sent", NO_LOGINS)
async def test_without_a_login_nothing_is_revealed_and_nothing_changes(connect: Connect, sent: bytes) -> None:
    async with PulseServer(FPS, expect={"c0"}, start_timeout=1000.0, users=USERS) as server:
        stranger = await connect(server.port)
        assert isinstance(await stranger.message(), LoginRequest)
        stranger.send(sent + b"HELLO 1 c0\nWHO\n")
        lines = (await stranger.read_to_end()).splitlines()
        assert len(lines) <= 1
        assert all(isinstance(parse_server_line(line), ErrorMessage) for line in lines)
        assert (server.clients(), server.missing(), server.pulse) == ((), ("c0",), None)


async def test_a_wrong_password_and_an_unknown_user_get_the_same_answer(connect: Connect) -> None:
    async with PulseServer(FPS, users=USERS) as server:
        answers = set()
        for user, password in (("c0", USERS["c1"]), ("unknown", USERS["c0"]), ("c0", "x")):
            stranger = await connect(server.port)
            await log_in(stranger, user, password)
            answers.add(await stranger.read_to_end())
        assert answers == {b"ERROR login unknown user or wrong password\n"}
        assert server.refused == 3


async def test_a_connection_that_sends_nothing_is_closed(connect: Connect) -> None:
    async with PulseServer(FPS, users=USERS, limits=ServerLimits(login_within=0.05)) as server:
        stranger = await connect(server.port)
        assert isinstance(await stranger.message(), LoginRequest)
        assert await stranger.read_to_end() == b"ERROR login no login in time\n"


async def test_a_user_cannot_use_the_name_of_another(connect: Connect) -> None:
    async with PulseServer(FPS, expect={"c0"}, start_timeout=1000.0, users=USERS) as server:
        other = await connect(server.port)
        await log_in(other, "c1", USERS["c1"])
        other.send(b"HELLO 1 c0\n")
        lines = [(await other.line()).rstrip() for _ in range(3)]
        assert isinstance(parse_server_line(lines[0]), Greeting)
        assert lines[1:] == [b"WAIT c0", b"ERROR name this connection is for c1 alone"]
        assert server.missing() == ("c0",)


async def test_a_login_where_none_is_needed_is_an_error_and_changes_nothing(connect: Connect) -> None:
    async with PulseServer(FPS, expect={"c0"}, start_timeout=1000.0) as server:
        client = await connect(server.port)
        client.send(encode(LoginMessage("c0", "x")) + b"PING 1\n")
        messages = [await client.message() for _ in range(4)]
        assert messages[2] == ErrorMessage("malformed", "this connection needs no login")
        assert isinstance(messages[3], Pong)


async def test_many_connections_without_a_login_lock_no_client_out(connect: Connect) -> None:
    limits = ServerLimits(pending_logins=4, clients=2, catch_up=PATIENCE)
    async with PulseServer(FPS, users=USERS, limits=limits) as server:
        crowd = [await connect(server.port) for _ in range(50)]
        async with PulseClient(LOCALHOST, server.port, "c0", settings=PATIENT, credentials=C0) as client:
            numbers = [pulse.number for pulse in await take(client, 20)]
            crowd += [await connect(server.port) for _ in range(50)]
            numbers += [pulse.number for pulse in await take(client, 20)]
            await until_refused(server, 96)
            assert [info.name for info in server.clients()] == ["c0"]
            assert client.status().connections == 1
        assert all(later == earlier + 1 for earlier, later in pairwise(numbers))


async def test_many_refused_logins_are_one_log_line(
    connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    async with PulseServer(FPS, users=USERS) as server:
        for _ in range(20):
            (await connect(server.port)).send(b"HELLO 1 c0\n")
        await until_refused(server, 20)
    refused = [record.getMessage() for record in caplog.records if record.name == "camsync.login"]
    assert len(refused) == 1
    assert "(1 so far): a login has to come first" in refused[0]


async def test_a_server_that_stops_notifies_pending_connections(connect: Connect) -> None:
    server = PulseServer(FPS, users=USERS)
    await server.start()
    stranger = await connect(server.port)
    assert isinstance(await stranger.message(), LoginRequest)
    await server.stop()
    assert await stranger.read_to_end() == b"ERROR stopped the server stops\n"


async def test_a_client_without_credentials_ends_with_one_clear_line() -> None:
    async with PulseServer(FPS, users=USERS) as server, PulseClient(LOCALHOST, server.port, "c0") as client:
        with pytest.raises(LoginError, match=r"^the pulse server needs a login, and this client has none$"):
            await take(client, 1)
        with pytest.raises(LoginError, match=r"needs a login$"):
            await query_clients(LOCALHOST, server.port)


async def test_a_client_whose_login_is_refused_counts_by_itself_and_tries_again(
    caplog: pytest.LogCaptureFixture,
) -> None:
    settings = ClientSettings(backoff_first=0.01, backoff_most=0.01, free_run_after=0.2)
    caplog.set_level(logging.WARNING, "camsync")
    async with PulseServer(FPS, users={"c0": "another"}) as server:
        async with PulseClient(LOCALHOST, server.port, "c0", settings=settings, credentials=C0) as client:
            pulses = await take(client, 3)
            assert all(pulse.local for pulse in pulses)
            assert client.status().connections == 0
            await until_refused(server, 3)
        with pytest.raises(LoginError, match="unknown user or wrong password"):
            await query_clients(LOCALHOST, server.port, PATIENCE, credentials=C0)
    client_loggers = {"camsync.client", "camsync.persistent_connection"}
    client_lines = [record.getMessage() for record in caplog.records if record.name in client_loggers]
    refusals = [line for line in client_lines if "wrong password" in line]
    assert len(refusals) == 1, "an absence is one line"


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two self-signed certificates for localhost: ``right.pem`` and ``other.pem``, each with its key."""
    folder = tmp_path_factory.mktemp("certificates")
    for name in ("right", "other"):
        words = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes"]
        words += [
            "-days",
            "2",
            "-subj",
            "/CN=localhost",
            "-addext",
            "subjectAltName=IP:127.0.0.1",
        ]
        words += ["-keyout", str(folder / f"{name}.key"), "-out", str(folder / f"{name}.pem")]
        subprocess.run(words, check=True, capture_output=True)
    return folder


def server_tls(folder: Path) -> ssl.SSLContext:
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(folder / "right.pem", folder / "right.key")
    return context


def client_tls(folder: Path, authority: str) -> ssl.SSLContext:
    return ssl.create_default_context(cafile=str(folder / f"{authority}.pem"))


@needs_openssl
async def test_over_tls_a_client_gets_every_pulse_and_may_list_the_clients(certificates: Path) -> None:
    limits = ServerLimits(catch_up=PATIENCE)
    tls, trusted = server_tls(certificates), client_tls(certificates, "right")
    async with PulseServer(FPS, users=USERS, limits=limits, tls=tls) as server:
        async with PulseClient(
            LOCALHOST, server.port, "c0", settings=PATIENT, credentials=C0, tls=trusted
        ) as client:
            numbers = [pulse.number for pulse in await take(client, 100)]
            listed = await query_clients(LOCALHOST, server.port, PATIENCE, credentials=C0, tls=trusted)
            assert ListedClient("c0", 0) in listed
            assert client.status().connections == 1
        assert all(later == earlier + 1 for earlier, later in pairwise(numbers))
        assert server.refused == 0


@needs_openssl
async def test_a_client_sends_no_password_to_an_untrusted_server(
    certificates: Path, caplog: pytest.LogCaptureFixture
) -> None:
    settings = ClientSettings(backoff_first=0.01, backoff_most=0.01, free_run_after=0.2)
    caplog.set_level(logging.WARNING, "camsync")
    trusted = client_tls(certificates, "other")
    async with PulseServer(FPS, users=USERS, tls=server_tls(certificates)) as server:
        async with PulseClient(
            LOCALHOST, server.port, "c0", settings=settings, credentials=C0, tls=trusted
        ) as client:
            assert all(pulse.local for pulse in await take(client, 3))
        with pytest.raises(SyncError, match=r"^no TLS with the pulse server at .*CERTIFICATE_VERIFY_FAILED"):
            await query_clients(LOCALHOST, server.port, PATIENCE, credentials=C0, tls=trusted)
        assert server.clients() == ()
    assert "is away: " in caplog.text


@needs_openssl
@pytest.mark.parametrize("sent", [b"", b"HELLO 1 c0\n", b"LOGIN c0 " + USERS["c0"].encode() + b"\n"])
async def test_without_tls_nothing_is_revealed(connect: Connect, certificates: Path, sent: bytes) -> None:
    limits = ServerLimits(login_within=0.2, pending_logins=4)
    async with PulseServer(FPS, users=USERS, limits=limits, tls=server_tls(certificates)) as server:
        strangers = [await connect(server.port) for _ in range(8)]
        for stranger in strangers:
            stranger.send(sent)
        for stranger in strangers:
            assert b"MYVIEW" not in await stranger.read_to_end()
        await until_refused(server, 8)
        assert server.clients() == ()


@needs_openssl
async def test_a_server_with_tls_and_without_users_accepts_any_client_over_tls(certificates: Path) -> None:
    trusted = client_tls(certificates, "right")
    async with (
        PulseServer(FPS, tls=server_tls(certificates)) as server,
        PulseClient(LOCALHOST, server.port, "c0", settings=PATIENT, tls=trusted) as client,
    ):
        await take(client, 3)
        assert client.status().connected
