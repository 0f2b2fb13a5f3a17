"""The server from raw sockets, as with `nc`."""

from __future__ import annotations

import asyncio
import logging
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camsync import PulseServer, ServerLimits
from camsync.messages import ErrorMessage, Greeting, Pong, PulseMessage, WaitMessage
from camsync.protocol import parse_server_line
from fakes.camsync.pulse_clients import Connect, JumpingClock, SteppedClock
from fakes.timeouts import PATIENCE

FPS = 400.0


async def test_a_client_that_sends_nothing_gets_all_pulses(connect: Connect) -> None:
    async with PulseServer(FPS, expect={"c0"}) as server:
        listener = await connect(server.port)
        greeting = await listener.message()
        assert isinstance(greeting, Greeting)
        assert (greeting.fps, greeting.pulse) == (FPS, None)
        assert await listener.message() == WaitMessage(("c0",))
        (await connect(server.port)).send(b"HELLO 1 c0\n")
        assert [(await listener.pulse()).number for _ in range(50)] == list(range(50))


async def test_a_pulse_is_due_at_epoch_plus_number_over_rate(connect: Connect) -> None:
    async with PulseServer(FPS) as server:
        listener = await connect(server.port)
        pulses = [await listener.pulse() for _ in range(100)]
        assert server.epoch is not None
        for pulse in pulses:
            assert pulse.due == pytest.approx(server.epoch + pulse.number / FPS, abs=1e-6)


async def test_without_expected_clients_the_server_begins_at_once() -> None:
    async with PulseServer(FPS, start_timeout=1000.0) as server:
        await server.wait_scheduled()
    async with PulseServer(FPS, expect={"c0"}, start_timeout=0.0) as server:
        await server.wait_scheduled()


async def test_the_server_begins_when_all_expected_clients_sent_hello(connect: Connect) -> None:
    async with PulseServer(FPS, expect={"c0", "c1", "bestview"}, start_timeout=1000.0) as server:
        listener = await connect(server.port)
        await listener.message()
        assert await listener.message() == WaitMessage(("bestview", "c0", "c1"))
        for name, missing in (
            ("c1", ("bestview", "c0")),
            ("stranger", ("bestview", "c0")),
            ("c0", ("bestview",)),
        ):
            (await connect(server.port)).send(f"HELLO 1 {name}\n".encode())
            assert await listener.message() == WaitMessage(missing)
        assert server.pulse is None
        (await connect(server.port)).send(b"HELLO 1 bestview\n")
        assert (await listener.pulse()).number == 0


async def test_a_client_that_leaves_before_the_first_pulse_is_waited_for_again(connect: Connect) -> None:
    async with PulseServer(FPS, expect={"c0", "c1"}, start_timeout=1000.0) as server:
        listener = await connect(server.port)
        await listener.message()
        await listener.message()
        gone = await connect(server.port)
        gone.send(b"HELLO 1 c0\n")
        assert await listener.message() == WaitMessage(("c1",))
        gone.writer.transport.abort()
        assert await listener.message() == WaitMessage(("c0", "c1"))


async def test_the_server_begins_without_missing_clients_after_the_timeout(
    connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, "camsync"):
        async with PulseServer(FPS, expect={"c0", "c9"}, start_timeout=0.05) as server:
            listener = await connect(server.port)
            listener.send(b"HELLO 1 c0\n")
            await listener.pulse()
    assert re.search(r"beginning without (c0, )?c9", caplog.text), "a slow machine misses c0, too"


async def test_a_listener_that_closes_its_sending_side_still_gets_pulses(connect: Connect) -> None:
    async with PulseServer(FPS, expect={"c0"}) as server:
        listener = await connect(server.port)
        listener.writer.write_eof()
        (await connect(server.port)).send(b"HELLO 1 c0\n")
        assert [(await listener.pulse()).number for _ in range(20)] == list(range(20))


async def test_a_late_joiner_gets_the_current_pulse_next(connect: Connect) -> None:
    async with PulseServer(FPS) as server:
        early = await connect(server.port)
        while (await early.pulse()).number < 60:
            pass
        late = await connect(server.port)
        greeting = await late.message()
        assert isinstance(greeting, Greeting)
        assert greeting.pulse is not None
        assert (await late.pulse()).number == greeting.pulse + 1


async def test_the_server_answers_with_its_clock(connect: Connect, jumping_clock: JumpingClock) -> None:
    async with PulseServer(FPS, clock=jumping_clock) as server:
        client = await connect(server.port)
        await client.message()
        before = jumping_clock()
        client.send(b"PING 12.5\r\n")
        pong = await client.non_pulse()
        assert isinstance(pong, Pong)
        assert pong.sent == 12.5
        assert before - 1e-6 <= pong.now <= jumping_clock() + 1e-6


async def test_a_wrong_line_is_answered_and_the_pulses_continue(connect: Connect) -> None:
    async with PulseServer(FPS) as server:
        client = await connect(server.port)
        await client.message()
        client.send(b"GET / HTTP/1.1\nHELLO 9 c0\nHELLO 1 c0\nHELLO 1 c1\n")
        codes = [await client.non_pulse() for _ in range(3)]
        assert [error.code for error in codes if isinstance(error, ErrorMessage)] == [
            "malformed",
            "version",
            "malformed",
        ]
        await client.pulse()
        (info,) = server.clients()
        assert (info.name, info.errors, info.dropped) == ("c0", 3, 0)


@pytest.mark.parametrize("noise", [b"x" * 100_000, b"x" * 400 + b"\n", b"\n" * 5000, b"PING 1\n" * 5000])
async def test_a_flooding_client_is_closed_and_others_get_all_pulses(connect: Connect, noise: bytes) -> None:
    async with PulseServer(FPS, limits=ServerLimits(line_burst=10)) as server:
        quiet, flooding = await connect(server.port), await connect(server.port)
        first = (await quiet.pulse()).number
        flooding.send(noise)
        await flooding.read_to_end()
        numbers = [(await quiet.pulse()).number for _ in range(20)]
        assert numbers == list(range(first + 1, first + 21))
        assert len(server.clients()) == 1


async def test_an_overlong_line_is_answered_with_an_error(connect: Connect) -> None:
    async with PulseServer(FPS) as server:
        client = await connect(server.port)
        await client.pulse()
        client.send(b"x" * 257)
        assert b"ERROR overlong" in await client.read_to_end()


async def test_a_second_client_of_a_name_replaces_the_first(connect: Connect) -> None:
    async with PulseServer(FPS) as server:
        older = await connect(server.port)
        older.send(b"HELLO 1 c0\n")
        await older.pulse()
        newer = await connect(server.port)
        newer.send(b"HELLO 1 c0\n")
        assert b"ERROR replaced" in await older.read_to_end()
        await newer.pulse()
        assert [info.name for info in server.clients()] == ["c0"]


async def test_a_client_that_does_not_read_loses_pulses_and_is_closed(connect: Connect) -> None:
    clock, limits = SteppedClock(), ServerLimits(backlog=16384, cut_off=PATIENCE)
    async with PulseServer(2048.0, limits=limits, clock=clock) as server:
        reader, stuck = await connect(server.port), await connect(server.port, receive=1)
        stuck.reader._transport.pause_reading()  # type: ignore[attr-defined]
        numbers: list[int] = []
        while not any(info.dropped for info in server.clients()):
            clock.now += 1 / 2048.0  # the next pulse only after this one is read: the reader stays up to date
            numbers.append((await reader.pulse()).number)
        assert numbers == list(range(numbers[0], numbers[-1] + 1))
        clock.now += PATIENCE + 1.0
        while len(server.clients()) == 2:
            await reader.pulse()
            clock.now += 1 / 2048.0
        assert [info.dropped for info in server.clients()] == [0]


async def test_a_vanished_client_is_removed_and_others_get_all_pulses(connect: Connect) -> None:
    async with PulseServer(FPS) as server:
        stays = await connect(server.port)
        numbers = [(await stays.pulse()).number]
        for _ in range(5):
            gone = await connect(server.port)
            gone.send(b"HELLO 1 c0\n")
            await gone.pulse()
            gone.writer.transport.abort()
        while len(server.clients()) > 1 or len(numbers) < 10:
            numbers.append((await stays.pulse()).number)
        assert numbers == list(range(numbers[0], numbers[-1] + 1))


async def test_after_a_long_stall_the_server_skips_to_the_current_pulse(
    connect: Connect, jumping_clock: JumpingClock
) -> None:
    async with PulseServer(FPS, clock=jumping_clock) as server:
        listener = await connect(server.port)
        before = await listener.pulse()
        jumping_clock.jumped += 3600.0
        numbers = [before.number]
        while numbers[-1] < 3600 * FPS:
            numbers.append((await listener.pulse()).number)
        assert len(numbers) < PATIENCE * FPS  # no burst of the 1.4 million between
        assert server.skipped > 3590 * FPS
        assert (await listener.pulse()).number == numbers[-1] + 1


async def test_after_a_short_stall_the_server_sends_every_pulse(
    connect: Connect, jumping_clock: JumpingClock
) -> None:
    async with PulseServer(FPS, clock=jumping_clock, limits=ServerLimits(catch_up=PATIENCE)) as server:
        listener = await connect(server.port)
        first = (await listener.pulse()).number
        jumping_clock.jumped += 0.2
        numbers = [(await listener.pulse()).number for _ in range(150)]
        assert numbers == list(range(first + 1, first + 151))
        assert server.skipped == 0


async def test_the_server_stops_at_max_pulses(connect: Connect) -> None:
    async with PulseServer(FPS, expect={"c0"}, max_pulses=20) as server:
        listener = await connect(server.port)
        listener.send(b"HELLO 1 c0\n")
        numbers = [(await listener.pulse()).number for _ in range(20)]
        await server.wait_ended()
        assert (numbers[-1], server.pulse) == (19, 19)


async def test_a_port_in_use_is_a_clear_error() -> None:
    async with PulseServer(FPS) as server:
        with pytest.raises(OSError, match=f"cannot listen on 127.0.0.1:{server.port}: .*in use"):
            await PulseServer(FPS, port=server.port).start()


@pytest.mark.parametrize("fps", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_rate_is_refused(fps: float) -> None:
    with pytest.raises(ValueError, match="fps"):
        PulseServer(fps)


def test_an_impossible_name_is_refused() -> None:
    with pytest.raises(ValueError, match="two words"):
        PulseServer(FPS, expect={"two words"})


noise = st.lists(
    st.binary(max_size=300)
    | st.sampled_from(
        [b"HELLO 1 c0\n", b"PING 1\n", b"HELLO 1 c0 last=5 ago=0\n", b"\r\n", b"HELLO 1 ", b"PING "]
    ),
    max_size=8,
)


@settings(deadline=None, max_examples=40)
@given(noise)
def test_noise_on_one_connection_does_not_disturb_another(pieces: list[bytes]) -> None:
    asyncio.run(_disturb(pieces))


async def _disturb(pieces: list[bytes]) -> None:
    async with asyncio.timeout(PATIENCE), PulseServer(FPS, expect={"c1"}, start_timeout=0.0) as server:
        listener, listener_out = await asyncio.open_connection("127.0.0.1", server.port)
        noisy, noisy_out = await asyncio.open_connection("127.0.0.1", server.port)
        for piece in pieces:
            noisy_out.write(piece)
        noisy_out.write(b"x" * 257 + b"\n")  # closes the connection if nothing before did
        received = await asyncio.gather(noisy.read(-1), return_exceptions=True)
        for line in received[0].splitlines() if isinstance(received[0], bytes) else ():
            assert parse_server_line(line) is not None
        messages = [parse_server_line((await listener.readline())[:-1]) for _ in range(6)]
        numbers = [message.number for message in messages if isinstance(message, PulseMessage)]
        assert numbers == list(range(numbers[0], numbers[0] + 5))
        for writer in (listener_out, noisy_out):
            writer.transport.abort()
            await asyncio.gather(writer.wait_closed(), return_exceptions=True)
