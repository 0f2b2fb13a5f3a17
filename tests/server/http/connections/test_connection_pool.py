"""Connection limits: idle connections make way, and operators are always admitted."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, ExitStack, aclosing, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes.http.certificates import make_certificate
from fakes.http.tokens import bearer, serve_with_tokens
from fakes.programs import needs_openssl
from fakes.service.fed_site import A, B, ServedSite, serve_site, show_people
from fakes.service.scripted_cameras import SMALL
from fakes.system.few_descriptors import MYVIEW, connect, running, wait_for_log, write_site
from server.http.access.csrf import CSRF_HEADER
from server.http.access.networks import network_of
from server.http.connections.connection_limiter import Connection, ConnectionLimiter, ConnectionLimits

Pair = tuple[asyncio.StreamReader, asyncio.StreamWriter]

ELSEWHERE = {"X-Forwarded-For": "10.0.0.7"}
"""Headers of a viewer at another machine, who may not operate."""
SOON = 0.2  # seconds
GET = "GET {} HTTP/1.1\r\nHost: localhost\r\n{}\r\n"


@asynccontextmanager
async def serve_small_site(**http: Any) -> AsyncIterator[ServedSite]:
    """Serve a site with people; timeouts are long unless a test sets them."""
    async with aclosing(serve_site(http={"request_timeout_s": 60.0, **http})) as sites:
        served = await anext(sites)
        show_people(served)
        yield served


async def open_silent(served: ServedSite, begin: str = "") -> Pair:
    """Connect, and send an incomplete request."""
    reader, writer = await asyncio.open_connection("127.0.0.1", served.port)
    writer.write(begin.encode())
    return reader, writer


async def read_to_end(pair: Pair) -> bytes:
    """Wait until the server closes a connection; return what it sent."""
    reader, writer = pair
    try:
        return await reader.read()
    except ConnectionResetError:
        return b""
    finally:
        writer.close()


async def stream(
    served: ServedSite, path: str = "/objects/1/best.ts", heads: str = "X-Forwarded-For: x\r\n"
) -> Pair:
    """Open a stream; return the connection once it has begun."""
    pair = await open_silent(served, GET.format(path, heads))
    assert (await pair[0].readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 200")
    return pair


async def status(served: ServedSite, path: str, **heads: str) -> int:
    """Send a request on a new connection."""
    lines = "".join(f"{name}: {value}\r\n" for name, value in {**heads, "Connection": "close"}.items())
    received = await read_to_end(await open_silent(served, GET.format(path, lines)))
    return int(received.split(maxsplit=2)[1]) if received else 0


@pytest.mark.parametrize("begin", ["", "GET /api/site HTTP/1.1\r\nHost: ha", "\r\n\r\n", "\x16\x03\x01"])
async def test_an_incomplete_request_times_out(begin: str) -> None:
    async with serve_small_site(request_timeout_s=SOON) as served:
        assert b" 200 " not in await read_to_end(await open_silent(served, begin))


async def test_an_incomplete_body_times_out(tmp_path: Path) -> None:
    async with serve_with_tokens(tmp_path, http={"request_timeout_s": SOON}) as served:
        head = f"POST /api/session HTTP/1.1\r\nHost: hall\r\n{CSRF_HEADER}: 1\r\nContent-Length: 99\r\n\r\n{{"
        assert await read_to_end(await open_silent(served, head)) == b""


async def test_a_body_above_the_limit_is_refused(tmp_path: Path) -> None:
    async with serve_with_tokens(tmp_path) as served:
        body = b" " * 70_000
        async with served.session.post("/api/session", data=body, headers={CSRF_HEADER: "1"}) as answer:
            assert answer.status == 413


async def test_an_idle_connection_is_closed() -> None:
    async with serve_small_site(keepalive_timeout_s=SOON) as served:
        received = await read_to_end(await open_silent(served, GET.format("/healthz", "")))
        assert received.endswith(b"ok\n")


@needs_openssl
async def test_a_missing_tls_handshake_times_out(tmp_path: Path) -> None:
    tls = make_certificate(tmp_path, "hall")
    async with serve_small_site(request_timeout_s=SOON, tls=tls.model_dump()) as served:
        for begin in ("", "GET / HTTP/1.1\r\n\r\n"):
            await read_to_end(await open_silent(served, begin))


@pytest.mark.parametrize("path", ["/objects/1/best.ts", "/api/events"])
async def test_a_connection_with_an_endless_answer_is_not_idle(path: str) -> None:
    async with serve_small_site(request_timeout_s=1.0, keepalive_timeout_s=SOON) as served:
        reader, writer = await stream(served, path)
        await read_to_end(await open_silent(served))  # equally idle, and newer
        while len(await reader.read(1 << 20)) == 1 << 20:
            pass  # the currently open ones
        served.service.feed(3, {A: {1: SMALL, 2: SMALL}, B: {}})
        assert await reader.read(1)
        writer.close()


async def test_at_the_limit_the_longest_waiting_connection_is_closed() -> None:
    async with serve_small_site(connections_max=3) as served:
        first, second, third = [await open_silent(served) for _ in range(3)]
        for _ in range(3):
            assert await status(served, "/api/site", **ELSEWHERE) == 200
        await read_to_end(first)
        second[1].write(GET.format("/healthz", "").encode())
        assert (await second[0].readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 200")
        for _, writer in (second, third):
            writer.close()


async def test_when_all_are_busy_operators_are_admitted_and_others_get_503() -> None:
    async with serve_small_site(connections_max=2) as served, AsyncExitStack() as stack:
        for _ in range(2):
            _, writer = await stream(served)
            stack.callback(writer.close)
        assert await status(served, "/api/site", **ELSEWHERE) == 503
        assert await status(served, "/objects/1/best.jpg", **ELSEWHERE) == 503
        for open_to_all in ("/healthz", "/", "/operator"):
            assert await status(served, open_to_all, **ELSEWHERE) == 200
        flood = [await open_silent(served) for _ in range(100)]
        assert await status(served, "/api/operator/cameras") == 200
        assert await status(served, "/api/site", **ELSEWHERE) == 503
        _, writer = await stream(served, heads="")
        stack.callback(writer.close)
        for _, writer in flood:
            writer.close()


async def test_when_all_are_busy_operators_are_recognized_by_token_or_session(tmp_path: Path) -> None:
    async with serve_with_tokens(tmp_path, http={"connections_max": 1}) as served:
        show_people(served)
        async with served.session.post(
            "/api/session", json={"token": "token-of-lead"}, headers={CSRF_HEADER: "1"}
        ) as answer:
            [cookie] = answer.cookies.values()
        desk, lead = bearer("desk"), bearer("lead")
        _, writer = await stream(served, heads=f"Authorization: {desk['Authorization']}\r\n")
        assert await status(served, "/api/site", **lead) == 200
        assert await status(served, "/api/site", Cookie=f"{cookie.key}={cookie.value}") == 200
        assert await status(served, "/api/site", **desk) == 503
        assert await status(served, "/api/site") == 503
        writer.close()


def test_a_flood_of_connections_leaves_descriptors_for_the_service(tmp_path: Path) -> None:
    path, log = write_site(tmp_path, 1), tmp_path / "log"
    port = int(path.read_text().partition("http:\n  port: ")[2].split()[0])
    ask = b"GET /%s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"
    with running(f"{MYVIEW} bestview {path}", log, descriptors=300), ExitStack() as flood:
        connect(port).close()
        for _ in range(500):
            flood.enter_context(connect(port))
        for route, expected in ((b"healthz", b"ok\n"), (b"metrics", b"process_open_fds")):
            with connect(port) as asking:
                asking.settimeout(60)
                asking.sendall(ask % route)
                answer = b""
                while some := asking.recv(1 << 16):
                    answer += some
            assert expected in answer
        (open_now,) = [line for line in answer.splitlines() if line.startswith(b"process_open_fds ")]
        assert float(open_now.split()[1]) < 300 - 32
        wait_for_log(log, b"http.connections_max")
    assert b"Traceback" not in log.read_bytes()
    assert len(log.read_bytes().splitlines()) < 20


class Fake:
    """A connection's other end."""

    def __init__(self) -> None:
        self.ended = False
        self.unsent = 0

    def abort(self) -> None:
        self.ended = True

    def get_write_buffer_size(self) -> int:
        return self.unsent


class Clock:
    """A clock that the test advances."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


BOUNDS = ConnectionLimits(most=6, per_address=3, for_operators=2, request_s=10.0, keepalive_s=100.0)
ADDRESSES = [
    "127.0.0.1",
    "10.0.0.1",
    "::ffff:10.0.0.1",
    "10.0.0.2",
    "2001:db8::1",
    "2001:db8::2",
    "2001:db8:0:1::1",
]
ACTS = st.lists(
    st.tuples(
        st.sampled_from(["comes", "comes", "comes", "asks", "is sent", "rests", "waits", "leaves", "time"]),
        st.sampled_from(ADDRESSES),
        st.integers(0, 7),
    ),
    max_size=60,
)


@given(ACTS)
def test_the_limit_holds_and_busy_connections_are_kept(acts: list[tuple[str, str, int]]) -> None:
    clock, open_connections, busy = Clock(), list[Connection](), set[int]()
    places = ConnectionLimiter(BOUNDS, clock)
    for act, address, choice in acts:
        connection = open_connections[choice % len(open_connections)] if open_connections else None
        if act == "comes":
            new = places.admit(address, Fake())
            if new is None:
                beyond = [connection for connection in open_connections if connection.is_reserved]
                assert len(beyond) == BOUNDS.for_operators
                assert all(id(connection) in busy for connection in beyond)
            else:
                open_connections.append(new)
        elif act == "time":
            clock.now += 5.0
            places.close_overdue()
        elif connection is not None and act in {"asks", "is sent"}:
            places.busy(connection)
            busy.add(id(connection))
            if act == "is sent":
                places.sending(connection)
        elif connection is not None:
            busy.discard(id(connection))
            {"rests": places.idle, "waits": places.receiving, "leaves": places.closed}[act](connection)
        assert not any(
            connection.transport.ended  # type: ignore[attr-defined]
            for connection in open_connections
            if id(connection) in busy
        )
        open_connections = [connection for connection in open_connections if not connection.closed]
        assert places.open == len(open_connections)
        assert (
            len([connection for connection in open_connections if not connection.is_reserved]) <= BOUNDS.most
        )
        assert (
            len([connection for connection in open_connections if connection.is_reserved])
            <= BOUNDS.for_operators
        )
        placed = Counter(connection.network for connection in open_connections if not connection.is_reserved)
        assert all(count <= BOUNDS.per_address for network, count in placed.items() if network != "127.0.0.1")
    for connection in open_connections:
        places.closed(connection)
    assert places.open == 0
    assert not places._per_network
    assert not any(places._waiting.values())
    assert not places._sending


def test_at_the_limit_of_an_address_its_own_connections_are_closed_first() -> None:
    places = ConnectionLimiter(BOUNDS)
    own = [places.admit("10.0.0.1", Fake()) for _ in range(3)]
    assert all(connection is not None for connection in own)
    fourth = places.admit("10.0.0.1", Fake())
    assert [connection.closed for connection in own if connection] == [True, False, False]
    for connection in [*own[1:], fourth]:
        assert connection is not None
        places.busy(connection)
    fifth = places.admit("::ffff:10.0.0.1", Fake())
    other = places.admit("10.0.0.2", Fake())
    assert fifth is not None
    assert other is not None
    assert (fifth.is_reserved, other.is_reserved) == (True, False)


def test_loopback_addresses_have_no_limit_per_address() -> None:
    places = ConnectionLimiter(BOUNDS)
    for _ in range(BOUNDS.most):
        connection = places.admit("127.0.0.1", Fake())
        assert connection is not None
        assert not connection.is_reserved
        places.busy(connection)


def test_a_large_network_does_not_take_reserved_connections_from_others() -> None:
    places = ConnectionLimiter(BOUNDS)
    for number in range(BOUNDS.most):
        connection = places.admit(f"10.0.1.{number}", Fake())
        assert connection is not None
        places.busy(connection)
    places.admit("10.0.0.9", Fake())
    operator = places.admit("10.0.0.1", Fake())
    assert operator is not None
    for _ in range(10):
        assert places.admit("10.0.0.9", Fake()) is not None
    assert not operator.closed


def test_a_stalled_answer_ends_and_a_slow_one_does_not() -> None:
    clock = Clock()
    places = ConnectionLimiter(BOUNDS, clock)
    wires = {name: Fake() for name in ("slow", "stalled")}
    for wire in wires.values():
        wire.unsent = 500_000
        connection = places.admit("10.0.0.1", wire)
        assert connection is not None
        places.busy(connection)
        places.sending(connection)
    for _ in range(100):
        clock.now += 1.0
        wires["slow"].unsent -= 1000
        places.close_overdue()
    assert {name: wire.ended for name, wire in wires.items()} == {"slow": False, "stalled": True}


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("10.0.0.1", "10.0.0.1", True),
        ("10.0.0.1", "::ffff:10.0.0.1", True),
        ("10.0.0.1", "10.0.0.2", False),
        ("2001:db8::1", "2001:db8::ffff:2", True),
        ("2001:db8::1", "2001:db8:0:1::1", False),
        ("?", "?", True),
    ],
)
def test_addresses_of_one_customer_are_one_network(one: str, other: str, same: bool) -> None:
    assert (network_of(one) == network_of(other)) == same
