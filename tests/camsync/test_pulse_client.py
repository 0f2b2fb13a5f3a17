"""The client with a real server: iterating, counting missed pulses, measuring the clock offset."""

from __future__ import annotations

import asyncio
import socket
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import camsync
from camsync import (
    ClientSettings,
    Pulse,
    PulseClient,
    PulseServer,
    ReplacedError,
    ServerLimits,
    SyncError,
    VersionError,
)
from camsync.clock import steady_unix_clock
from camsync.messages import Greeting, PulseMessage
from camsync.protocol import encode
from camsync.pulse_schedule import PulseSchedule
from fakes.camsync.pulse_clients import (
    CLOCK_TOLERANCE,
    FPS,
    QUICK_SETTINGS,
    JumpingClock,
    fake_server,
    next_pulses,
)
from fakes.timeouts import PATIENCE


async def wait_counted(client: PulseClient, number: int) -> None:
    """Wait until the client has counted to ``number``, without consuming pulses."""
    async with asyncio.timeout(PATIENCE):
        while (client.status().pulse or 0) < number:  # noqa: ASYNC110 — consuming pulses is the only event
            await asyncio.sleep(0)


async def test_clients_that_are_expected_all_get_every_pulse_from_the_first_on() -> None:
    names = ["c0", "c1", "bestview"]
    patient = ClientSettings(local_after=PATIENCE, queue=200)
    async with PulseServer(FPS, expect=names, limits=ServerLimits(catch_up=PATIENCE)) as server:
        clients = [PulseClient("127.0.0.1", server.port, name, settings=patient) for name in names]
        received = await asyncio.gather(*(next_pulses(client, 100) for client in clients))
        for pulses in received:
            assert [pulse.number for pulse in pulses] == list(range(100))
            assert not any(pulse.missed or pulse.local for pulse in pulses)
        for same_number in zip(*received, strict=True):
            dues = [pulse.due for pulse in same_number]
            assert max(dues) - min(dues) < CLOCK_TOLERANCE
        assert {info.name for info in server.clients()} == set(names)
        for client in clients:
            assert client.status().fps == FPS
            await client.close()


async def test_due_times_are_one_frame_apart_and_before_arrival() -> None:
    async with PulseServer(FPS) as server, PulseClient("127.0.0.1", server.port, "c0") as client:
        pulses = await next_pulses(client, 200)
        first = pulses[0]
        for pulse in pulses:
            assert pulse.due == pytest.approx(
                first.due + (pulse.number - first.number) / FPS, abs=CLOCK_TOLERANCE
            )
            assert pulse.received > pulse.due - CLOCK_TOLERANCE
        epochs = [pulse.due - pulse.number / FPS for pulse in pulses]
        assert np.median(np.abs(np.diff(epochs))) < 0.1 / FPS, "the offset to the server's clock is stable"


async def test_the_offset_of_the_servers_clock_is_measured(jumping_clock: JumpingClock) -> None:
    jumping_clock.jumped = 1234.5
    async with (
        PulseServer(FPS, clock=jumping_clock) as server,
        PulseClient("127.0.0.1", server.port, "c0", settings=QUICK_SETTINGS) as client,
    ):
        async with asyncio.timeout(PATIENCE):
            while (await anext(client)).number >= 0 and client.status().round_trip is None:
                pass
        status = client.status()
        assert status.offset == pytest.approx(1234.5, abs=CLOCK_TOLERANCE)
        assert status.round_trip is not None
        assert 0.0 <= status.round_trip < PATIENCE
        (pulse,) = await next_pulses(client, 1)
        assert pulse.due == pytest.approx(client.client_now(), abs=20 * CLOCK_TOLERANCE)


async def test_a_slow_consumer_gets_the_number_of_missed_pulses() -> None:
    settings = ClientSettings(queue=1)
    async with (
        PulseServer(FPS) as server,
        PulseClient("127.0.0.1", server.port, "c0", settings=settings) as client,
    ):
        (first,) = await next_pulses(client, 1)
        await wait_counted(client, first.number + 30)
        newest = client.status().pulse
        (late,) = await next_pulses(client, 1)
        assert late.number == newest
        assert late.missed == late.number - first.number - 1
        assert client.missed == late.missed


async def test_a_short_stall_of_the_consumer_costs_nothing() -> None:
    settings = ClientSettings(queue=round(PATIENCE * FPS), catch_up=PATIENCE)
    async with (
        PulseServer(FPS, limits=ServerLimits(catch_up=PATIENCE)) as server,
        PulseClient("127.0.0.1", server.port, "c0", settings=settings) as client,
    ):
        (first,) = await next_pulses(client, 1)
        await wait_counted(client, first.number + 40)
        numbers = [pulse.number for pulse in await next_pulses(client, 60)]
        assert numbers == list(range(first.number + 1, first.number + 61))
        assert client.missed == 0


async def test_a_stalled_process_reads_the_waiting_pulses_first() -> None:
    server = await asyncio.create_subprocess_exec(
        sys.executable, "-c", _SERVER, stdout=asyncio.subprocess.PIPE, cwd=Path(camsync.__file__).parents[1]
    )
    assert server.stdout is not None
    port = int(await server.stdout.readline())
    settings = ClientSettings(catch_up=0.1)  # pulses that are not read first are lost
    try:
        async with PulseClient("127.0.0.1", port, "c0", settings=settings) as client:
            (first,) = await next_pulses(client, 1)
            time.sleep(0.7)  # noqa: ASYNC251 — the stall under test
            numbers = [pulse.number for pulse in await next_pulses(client, 40)]
            assert numbers == list(range(first.number + 1, first.number + 41))
    finally:
        server.kill()
        await server.wait()


_SERVER = """
import asyncio, camsync
async def main():
    async with camsync.PulseServer(50.0, expect={"c0"}) as server:
        print(server.port, flush=True)
        await server.wait_ended()
asyncio.run(main())
"""


async def test_skipped_numbers_are_counted_as_missed(jumping_clock: JumpingClock) -> None:
    async with (
        PulseServer(FPS, clock=jumping_clock) as server,
        PulseClient("127.0.0.1", server.port, "c0") as client,
    ):
        await next_pulses(client, 5)
        missed = client.missed  # on a busy machine some are missed before
        jumping_clock.jumped += 10.0
        async with asyncio.timeout(PATIENCE):
            async for pulse in client:
                before, missed = missed, client.missed
                if pulse.missed > 9.5 * FPS:
                    break
        assert client.missed == before + pulse.missed


async def test_the_newer_client_of_a_name_stays_and_the_older_ends() -> None:
    async with PulseServer(FPS) as server, PulseClient("127.0.0.1", server.port, "c0") as older:
        await next_pulses(older, 1)
        async with PulseClient("127.0.0.1", server.port, "c0") as newer:
            await next_pulses(newer, 5)
            with pytest.raises(ReplacedError, match="c0"):
                await next_pulses(older, 10_000)
            await next_pulses(newer, 5)


async def test_without_a_server_the_client_waits() -> None:
    with socket.socket() as bound:  # bound and not listening
        bound.bind(("127.0.0.1", 0))
        port = bound.getsockname()[1]
        async with PulseClient("127.0.0.1", port, "c0", fps_hint=FPS, settings=QUICK_SETTINGS) as client:
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.2):
                    await anext(client)
            assert not client.status().connected


async def test_without_a_server_the_client_free_runs_if_configured_and_a_server_continues_the_count() -> None:
    settings = ClientSettings(backoff_first=0.01, backoff_most=0.05, free_run_after=0.05)
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        port = bound.getsockname()[1]
        client = PulseClient("127.0.0.1", port, "c0", fps_hint=FPS, settings=settings)
        pulses = await next_pulses(client, 50)
    assert [pulse.number for pulse in pulses] == list(range(50))
    assert all(pulse.local for pulse in pulses)
    async with PulseServer(FPS, expect={"c0"}, port=port), asyncio.timeout(PATIENCE):
        number = pulses[-1].number
        async for pulse in client:
            assert pulse.number > number
            number = pulse.number
            if not pulse.local:
                break
    await client.close()


async def test_closing_ends_the_iteration() -> None:
    async with PulseServer(FPS, expect={"c0", "c1"}, start_timeout=1000.0) as server:
        client = PulseClient("127.0.0.1", server.port, "c0")
        waiting = asyncio.create_task(take_all(client))
        async with asyncio.timeout(PATIENCE):
            while not client.status().waiting_for:  # noqa: ASYNC110 — the client has no event for this
                await asyncio.sleep(0)
        assert "c1" in client.status().waiting_for
        await client.close()
        assert await waiting == []
        await client.close()  # closing twice is harmless


async def take_all(client: PulseClient) -> list[Pulse]:
    return [pulse async for pulse in client]


async def test_a_silent_server_is_disconnected_and_reconnected() -> None:
    clock = steady_unix_clock()
    schedule = PulseSchedule.through(7, clock(), FPS)

    def one_pulse() -> bytes:
        number = schedule.number_at(clock())
        pulse = PulseMessage(number, schedule.due(number))
        return encode(Greeting(1, FPS, clock(), None)) + encode(pulse)

    async with (
        fake_server(one_pulse) as (port, _),
        PulseClient("127.0.0.1", port, "c0", settings=QUICK_SETTINGS) as client,
    ):
        numbers = []
        while client.status().connections < 3:
            numbers += [pulse.number for pulse in await next_pulses(client, 1)]
        assert numbers == sorted(set(numbers))
        assert client.status().local_pulses > 0


@pytest.mark.parametrize("noise", [b"HTTP/1.1 400 Bad Request\r\n\r\n", b"\x00\xff" * 10, b"x" * 50_000])
async def test_another_service_on_the_port_is_not_a_server(noise: bytes) -> None:
    async with (
        fake_server(lambda: noise) as (port, calls),
        PulseClient("127.0.0.1", port, "c0", settings=QUICK_SETTINGS) as client,
    ):
        async with asyncio.timeout(PATIENCE):
            await calls.acquire()
            await calls.acquire()  # it has disconnected and tried again
        assert client.status().connections == 0


async def test_a_server_of_another_version_is_an_error() -> None:
    async with (
        fake_server(lambda: b"MYVIEW-SYNC 3 rate:25\n") as (port, _),
        PulseClient("127.0.0.1", port, "c0") as client,
    ):
        with pytest.raises(VersionError, match="version 3"):
            await next_pulses(client, 1)


async def test_a_malformed_host_name_is_an_error() -> None:
    async with PulseClient("two..dots", 1, "c0", settings=QUICK_SETTINGS) as client:
        with pytest.raises(SyncError, match=r"two\.\.dots"):
            await next_pulses(client, 1)


def test_an_impossible_name_or_rate_is_refused() -> None:
    with pytest.raises(ValueError, match="a b"):
        PulseClient("127.0.0.1", 1, "a b")
    with pytest.raises(ValueError, match="fps_hint"):
        PulseClient("127.0.0.1", 1, "c0", fps_hint=0.0)
