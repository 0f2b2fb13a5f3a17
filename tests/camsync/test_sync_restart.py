"""The server disappears and returns: clients continue to count and then follow it again."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest

from camsync import ClientSettings, Pulse, PulseClient, PulseServer, ScheduleLostError, ServerLimits
from camsync.messages import Pong
from fakes.camsync.pulse_clients import CLOCK_TOLERANCE, Connect
from fakes.timeouts import PATIENCE

FPS = 200.0
AWAY = round(1.5 * CLOCK_TOLERANCE * FPS)
"""Pulses counted without a server: enough to detect a new server that starts again from 0."""
QUICK = ClientSettings(backoff_first=0.01, backoff_most=0.05)


async def until(client: PulseClient, enough: Callable[[Pulse], bool]) -> list[Pulse]:
    """Consume pulses up to and including the first for which ``enough`` is true."""
    pulses = []
    async with asyncio.timeout(PATIENCE):
        async for pulse in client:
            pulses.append(pulse)
            if enough(pulse):
                break
    return pulses


def from_server(pulse: Pulse) -> bool:
    return not pulse.local


@pytest.mark.parametrize("claim", [b"last=500000000000", b"last=9999999999999", b"last=1 ago=999999999999"])
@pytest.mark.parametrize("expect", [(), ("c0",)])
async def test_an_implausible_claim_is_ignored(
    connect: Connect, expect: tuple[str, ...], claim: bytes
) -> None:
    async with PulseServer(FPS, expect=expect) as server:
        lying, other = await connect(server.port), await connect(server.port)
        lying.send(b"HELLO 1 c0 " + claim + b"\nPING 1\n")
        while not isinstance(await lying.message(), Pong):
            pass
        assert (await other.pulse()).number < PATIENCE * FPS


async def test_while_the_server_is_away_the_client_continues_at_the_same_rate() -> None:
    async with PulseServer(FPS) as server:
        client = PulseClient("127.0.0.1", server.port, "c0", settings=QUICK)
        before = (await until(client, lambda pulse: pulse.number >= 20))[-1]
    local = await until(client, lambda pulse: pulse.number >= before.number + 60)
    assert local[-1].local
    assert [pulse.number for pulse in local] == list(range(before.number + 1, local[-1].number + 1))
    for pulse in local:
        assert pulse.due == pytest.approx(
            before.due + (pulse.number - before.number) / FPS, abs=CLOCK_TOLERANCE
        )
        assert pulse.received > pulse.due - CLOCK_TOLERANCE
    assert client.status().local_pulses >= sum(pulse.local for pulse in local) > 0
    assert client.missed == 0
    await client.close()


@pytest.mark.parametrize("expect", [(), ("c0",), ("c0", "c1", "absent")])
async def test_a_restarted_server_continues_the_clients_count(expect: tuple[str, ...]) -> None:
    async with PulseServer(FPS, expect={"c0", "c1"}) as server:
        port, epoch = server.port, server.epoch
        clients = [PulseClient("127.0.0.1", port, name, settings=QUICK) for name in ("c0", "c1")]
        await asyncio.gather(*(until(client, lambda pulse: pulse.number >= 40) for client in clients))
        epoch = server.epoch
    away = await asyncio.gather(*(until(client, lambda pulse: pulse.number >= AWAY) for client in clients))
    limits = ServerLimits(claims_for=0.1)
    async with PulseServer(FPS, port=port, expect=expect, start_timeout=1000.0, limits=limits) as again:
        back = await asyncio.gather(*(until(client, from_server) for client in clients))
        for client, first, then in zip(clients, away, back, strict=True):
            numbers = [pulse.number for pulse in first + then]
            assert numbers == sorted(set(numbers))
            assert client.status().connections == 2
        reached = max(pulses[-1].number for pulses in back)
        # The schedule is the old one, up to measurement errors.
        assert epoch is not None
        assert again.epoch == pytest.approx(epoch, abs=CLOCK_TOLERANCE)
        both = await asyncio.gather(
            *(until(client, lambda pulse: pulse.number >= reached + AWAY) for client in clients)
        )
        dues = [{pulse.number: pulse.due for pulse in pulses} for pulses in both]
        shared = dues[0].keys() & dues[1].keys()
        assert len(shared) > 30
        assert all(abs(dues[0][number] - dues[1][number]) < CLOCK_TOLERANCE for number in shared)
    for client in clients:
        await client.close()


async def test_a_new_camera_joins_the_continued_schedule(connect: Connect) -> None:
    async with PulseServer(FPS, expect={"c0", "c1"}, start_timeout=1000.0) as server:
        (await connect(server.port)).send(b"HELLO 1 c0 last=5000 ago=1.0\n")
        new = await connect(server.port)
        new.send(b"HELLO 1 c1\n")
        assert (await new.pulse()).number == pytest.approx(5000 + FPS, abs=20 * CLOCK_TOLERANCE * FPS)


async def test_the_count_of_most_clients_moves_a_new_server_forward(connect: Connect) -> None:
    async with PulseServer(FPS) as server:
        listener = await connect(server.port)
        await listener.pulse()
        (await connect(server.port)).send(b"HELLO 1 c0 last=10000 ago=0\n")
        numbers = [(await listener.pulse()).number for _ in range(20)]
        while numbers[-1] < 10_000:
            numbers.append((await listener.pulse()).number)
        (await connect(server.port)).send(b"HELLO 1 c1 last=5000 ago=0\n")
        for name in ("c2", "c3", "c4"):
            (await connect(server.port)).send(f"HELLO 1 {name} last=20000 ago=0\n".encode())
        while numbers[-1] < 20_000:
            numbers.append((await listener.pulse()).number)
        assert numbers == sorted(set(numbers))
        assert len(numbers) < 5000
        assert server.skipped > 15_000


async def test_an_unexpected_client_cannot_move_the_schedule(connect: Connect) -> None:
    async with PulseServer(FPS, expect={"c0"}, start_timeout=0.0) as server:
        stranger = await connect(server.port)
        stranger.send(b"HELLO 1 stranger last=1000000 ago=0\n")
        assert all([(await stranger.pulse()).number < 1_000_000 for _ in range(20)])
        assert server.skipped == 0


async def test_a_running_server_is_not_moved_and_the_client_reports_a_lost_schedule() -> None:
    settings = ClientSettings(backoff_first=0.01, backoff_most=0.05, ahead_most=0.2, settle=0.05)
    async with PulseServer(FPS) as server:
        port = server.port
        client = PulseClient("127.0.0.1", port, "c0", settings=settings)
        await until(client, lambda pulse: pulse.number >= 150)
    async with PulseServer(FPS, port=port, limits=ServerLimits(adopt_for=-1.0)) as again:
        with pytest.raises(ScheduleLostError, match="c0"):
            await until(client, lambda pulse: pulse.number > 100_000)
        assert again.skipped == 0
    await client.close()


async def test_a_client_slightly_ahead_waits_for_the_server() -> None:
    async with PulseServer(FPS) as server:
        port = server.port
        client = PulseClient("127.0.0.1", port, "c0", settings=QUICK)
        await until(client, lambda pulse: pulse.number >= 50)
    async with PulseServer(FPS, port=port, limits=ServerLimits(adopt_for=-1.0)) as again:
        pulses = await until(client, lambda pulse: from_server(pulse) and again.pulse is not None)
        numbers = [pulse.number for pulse in pulses]
        assert numbers == sorted(set(numbers))
        assert again.pulse is not None
        assert again.pulse - pulses[-1].number < 20 * CLOCK_TOLERANCE * FPS
    await client.close()
