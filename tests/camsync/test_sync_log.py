"""Repeated failures are one log line, not one for each attempt, line or stall."""

from __future__ import annotations

import logging

import pytest

from camsync import PulseClient, PulseServer
from camsync.clock import steady_unix_clock
from camsync.messages import Greeting, Pong, PulseMessage
from camsync.protocol import encode
from camsync.pulse_schedule import PulseSchedule
from fakes.camsync.pulse_clients import FPS, QUICK_SETTINGS, Connect, JumpingClock, fake_server, next_pulses
from fakes.timeouts import PATIENCE


async def test_repeated_absences_of_the_server_are_few_log_lines(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO, "camsync")
    clock = steady_unix_clock()
    schedule = PulseSchedule.through(7, clock(), FPS)

    def one_pulse() -> bytes:
        number = schedule.number_at(clock())
        return encode(Greeting(1, FPS, clock(), None)) + encode(PulseMessage(number, schedule.due(number)))

    async with (
        fake_server(one_pulse) as (port, _),
        PulseClient("127.0.0.1", port, "c0", settings=QUICK_SETTINGS) as client,
    ):
        while client.status().connections < 6:
            await next_pulses(client, 1)
    connected, away, reconnected = caplog.messages
    assert connected.endswith(f": {FPS:g} pulses per second")
    assert away.endswith(" is away: nothing received for 0.3 seconds")
    assert f": {FPS:g} pulses per second, after " in reconnected


async def test_repeated_hellos_are_one_log_line(connect: Connect, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "camsync")
    async with PulseServer(FPS) as server:
        client = await connect(server.port)
        client.send(b"HELLO 1 c0\n" * 10 + b"PING 1\n")
        while not isinstance(await client.message(), Pong):
            pass
    assert caplog.messages == ["c0 connected"]


async def test_repeated_implausible_claims_are_one_log_line(
    connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    async with PulseServer(FPS) as server:
        lying = await connect(server.port)
        lying.send(b"HELLO 1 c0 last=500000000000\n" * 10 + b"PING 1\n")
        while not isinstance(await lying.message(), Pong):
            pass
    assert len(caplog.messages) == 1
    assert caplog.messages[0].endswith(": claim ignored")


async def test_repeated_stalls_are_one_log_line(
    connect: Connect, jumping_clock: JumpingClock, caplog: pytest.LogCaptureFixture
) -> None:
    async with PulseServer(FPS, clock=jumping_clock) as server:
        listener = await connect(server.port)
        number = (await listener.pulse()).number
        for _ in range(5):
            skipped = server.skipped
            jumping_clock.jumped += 2.0
            while server.skipped == skipped:
                number = (await listener.pulse()).number
    assert number < PATIENCE * FPS
    assert len(caplog.messages) == 1
    assert "late by " in caplog.messages[0]
