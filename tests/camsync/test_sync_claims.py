"""The count that a single client claims does not move the schedule of several clients."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camsync import ClientSettings, Credentials, PulseClient, PulseServer, ServerLimits, SyncError
from camsync.messages import CountedPulse, Hello, LoginMessage, LoginRequest, Pong
from camsync.protocol import LAST_PULSE, ProtocolError, encode, parse_client_line, parse_server_line
from camsync.pulse_schedule import PulseSchedule
from camsync.schedule_claims import ScheduleClaims
from fakes.camsync.pulse_clients import CLOCK_TOLERANCE, Connect, RawConnection
from fakes.timeouts import PATIENCE
from server.messaging import number_types

FPS = 200.0
LOCALHOST = "127.0.0.1"
NAMES = ("bestview", "c0", "c1", "c2")
USERS = {name: f"{name:x<32}" for name in NAMES}
FAR = 10**9
"""Two months at 200 a second: plausible, and false only by the claims of the other clients."""
SOON = ServerLimits(claims_for=0.1)
QUICK = ClientSettings(backoff_first=0.01, backoff_most=0.05, queue=100_000)


class LyingClient:
    """A logged-in connection that sends arbitrary lines."""

    def __init__(self, connection: RawConnection) -> None:
        self._connection = connection

    async def send(self, line: str) -> None:
        """Send a line and wait until it was handled."""
        self._connection.send(f"{line}\nPING 1\n".encode())
        while not isinstance(await self._connection.message(), Pong):
            pass


async def log_in(connect: Connect, port: int, user: str) -> LyingClient:
    connection = await connect(port)
    assert isinstance(await connection.message(), LoginRequest)
    connection.send(encode(LoginMessage(user, USERS[user])))
    return LyingClient(connection)


def client_of(port: int, name: str) -> PulseClient:
    return PulseClient(LOCALHOST, port, name, settings=QUICK, credentials=Credentials(name, USERS[name]))


async def take_numbers(client: PulseClient, count: int) -> list[int]:
    async with asyncio.timeout(PATIENCE):
        return [(await anext(client)).number for _ in range(count)]


@pytest.mark.parametrize("claim", ["last=500000000000", f"last={FAR} ago=0.1"])
async def test_a_single_claim_does_not_set_the_first_pulse(connect: Connect, claim: str) -> None:
    async with PulseServer(FPS, expect=NAMES, start_timeout=1000.0, users=USERS, limits=SOON) as server:
        lying = await log_in(connect, server.port, "c0")
        await lying.send(f"HELLO 1 c0 {claim}")
        clients = [client_of(server.port, name) for name in NAMES if name != "c0"]
        for client in clients:
            client.start()
        assert [await take_numbers(client, 3) for client in clients] == [[0, 1, 2]] * 3
        for client in clients:
            await client.close()


@pytest.mark.parametrize("names", [NAMES, NAMES[:2]])
@pytest.mark.parametrize("claim", ["last=500000000000", f"last={FAR} ago=0.1"])
async def test_a_single_claim_does_not_move_the_schedule(
    connect: Connect, claim: str, names: tuple[str, ...]
) -> None:
    async with PulseServer(FPS, expect=names, start_timeout=0.0, users=USERS) as server:
        async with client_of(server.port, "bestview") as client:
            before = await take_numbers(client, 3)
            lying = await log_in(connect, server.port, "c0")
            for _ in range(3):
                await lying.send(f"HELLO 1 c0 {claim}")
            after = await take_numbers(client, 20)
        assert server.skipped < PATIENCE * FPS
        assert after[-1] < before[0] + PATIENCE * FPS


async def test_a_restarted_server_continues_the_count_of_all_but_one_client(connect: Connect) -> None:
    names = [name for name in NAMES if name != "c0"]
    async with PulseServer(FPS, expect=names, users=USERS) as server:
        port = server.port
        clients = [client_of(port, name) for name in names]
        for client in clients:
            client.start()
        for client in clients:
            await take_numbers(client, 40)
        epoch = server.epoch
    assert epoch is not None
    async with PulseServer(
        FPS, port=port, expect=NAMES, start_timeout=1000.0, users=USERS, limits=SOON
    ) as again:
        lying = await log_in(connect, port, "c0")
        await lying.send(f"HELLO 1 c0 last={FAR}")
        await again.wait_scheduled()
        assert again.epoch == pytest.approx(epoch, abs=CLOCK_TOLERANCE)
        await lying.send(f"HELLO 1 c0 last={FAR}")
        assert again.epoch == pytest.approx(epoch, abs=CLOCK_TOLERANCE)
    for client in clients:
        await client.close()


async def test_a_low_claim_does_not_hold_other_clients_back(connect: Connect) -> None:
    async with PulseServer(FPS, expect=NAMES, start_timeout=1000.0, users=USERS, limits=SOON) as server:
        lying = await log_in(connect, server.port, "c0")
        await lying.send("HELLO 1 c0 last=1")
        for name in ("c1", "c2"):
            await (await log_in(connect, server.port, name)).send(f"HELLO 1 {name} last=50000")
        async with client_of(server.port, "bestview") as client:
            assert (await take_numbers(client, 1))[0] >= 50_000


async def test_a_client_far_ahead_of_all_others_has_to_restart() -> None:
    """The server cannot know whether it lies; the client gets an error and can restart."""
    settings = ClientSettings(backoff_first=0.01, backoff_most=0.05, ahead_most=0.1, settle=0.05)
    alone = PulseClient(LOCALHOST, 1, "c0", settings=settings, credentials=Credentials("c0", USERS["c0"]))
    alone._counter.accept(10**6, alone.client_now())
    async with PulseServer(FPS, expect=NAMES, start_timeout=0.0, users=USERS) as server:
        alone._server._port = server.port
        with pytest.raises(SyncError, match="the server is at pulse"):
            await take_numbers(alone, 10**6)
        assert server.skipped < 10**6
        await alone.close()


def agreed(counts: Sequence[int | None], expect: int, *, at: int | None = None) -> int | None:
    """Return the pulse number agreed on by clients c0, c1, …, which claim ``counts`` (None: no claim).

    ``at``: the current pulse of a server that has begun.
    """
    names = [f"c{number}" for number in range(len(counts))]
    claims = ScheduleClaims(1.0, [f"c{number}" for number in range(expect)], ServerLimits(), lambda: 0.0)
    for name, count in zip(names, counts, strict=True):
        claims.record(Hello(name, None if count is None else CountedPulse(count, 0.0)))
    claims.keep_only(names)
    schedule = claims.median_schedule(None if at is None else PulseSchedule.through(at, 0.0, 1.0))
    return None if schedule is None else schedule.number_at(0.0)


@pytest.mark.parametrize(
    ("counts", "expect", "at", "agreed_number"),
    [
        ([70], 0, None, 70),
        ([70], 1, None, 70),
        ([70], 2, None, 70),
        ([70, None], 2, None, 70),
        ([70, 10], 2, None, 10),
        ([70], 3, None, None),
        ([70, None, None], 3, None, None),
        ([70, 10, None], 3, None, 10),
        ([70, 10, 10], 3, None, 10),
        ([1, 10, 10], 3, None, 10),
        ([70, 70, 10, 10], 4, None, 10),
        ([70, None], 2, 10, 10),
        ([70, 70, None], 3, 10, 70),
        ([70, 70, None, None], 4, 10, 10),
        ([70], 2, 10, 70),
        ([None], 1, 10, None),
    ],
)
def test_the_lower_median_of_the_claims_counts(
    counts: list[int | None], expect: int, at: int | None, agreed_number: int | None
) -> None:
    assert agreed(counts, expect, at=at) == agreed_number


@settings(deadline=None, max_examples=100)
@given(
    st.lists(st.integers(0, 10**8), max_size=6),
    st.integers(0, 10**6),
    st.integers(0, 10),
    st.randoms(use_true_random=False),
)
def test_fewer_than_half_of_the_clients_cannot_move_the_schedule(
    lies: list[int], truth: int, more: int, random: object
) -> None:
    counts = [*lies, *[truth] * (len(lies) + 2 + more)]
    random.shuffle(counts)  # type: ignore[attr-defined]
    assert agreed(counts, len(counts)) == truth


@pytest.mark.parametrize("number", [LAST_PULSE + 1, 2**53, 10**18])
def test_a_number_beyond_the_last_pulse_is_no_pulse(number: int) -> None:
    for parse, line in ((parse_client_line, "HELLO 1 c0 last={}"), (parse_server_line, "PULSE {} 1")):
        assert parse(line.format(LAST_PULSE).encode()) is not None
        with pytest.raises(ProtocolError):
            parse(line.format(number).encode())


def test_the_last_pulse_is_the_same_on_the_bus() -> None:
    assert number_types.PULSE_MAX == LAST_PULSE < 2**53
