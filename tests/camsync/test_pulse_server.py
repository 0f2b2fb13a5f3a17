"""The server seen with bare sockets, as with `nc`."""

from __future__ import annotations

import asyncio
import logging

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camsync import PulseServer, ServerLimits
from camsync.messages import ErrorMessage, Greeting, Pong, PulseMessage, WaitMessage
from camsync.protocol import parse_server_line
from fakes.camsync.pulse_clients import Connect, JumpingClock
from fakes.timeouts import PATIENCE

FPS = 400.0


async def test_a_client_that_sends_nothing_gets_all_pulses(by_hand: Connect) -> None:
    async with PulseServer(FPS, expect={"c0"}) as server:
        listener = await by_hand(server.port)
        greeting = await listener.message()
        assert isinstance(greeting, Greeting)
        assert (greeting.fps, greeting.pulse) == (FPS, None)
        assert await listener.message() == WaitMessage(("c0",))
        (await by_hand(server.port)).say(b"HELLO 1 c0\n")
        assert [(await listener.beat()).number for _ in range(50)] == list(range(50))


async def test_a_pulse_is_due_at_epoch_plus_number_over_rate(by_hand: Connect) -> None:
    async with PulseServer(FPS) as server:
        listener = await by_hand(server.port)
        beats = [await listener.beat() for _ in range(100)]
        assert server.epoch is not None
        for beat in beats:
            assert beat.due == pytest.approx(server.epoch + beat.number / FPS, abs=1e-6)


async def test_without_expected_clients_the_server_begins_at_once() -> None:
    async with PulseServer(FPS, start_timeout=1000.0) as server:
        await server.wait_begun()
    async with PulseServer(FPS, expect={"c0"}, start_timeout=0.0) as server:
        await server.wait_begun()


async def test_the_server_begins_when_all_expected_clients_sent_hello(by_hand: Connect) -> None:
    async with PulseServer(FPS, expect={"c0", "c1", "bestview"}, start_timeout=1000.0) as server:
        listener = await by_hand(server.port)
        await listener.message()
        assert await listener.message() == WaitMessage(("bestview", "c0", "c1"))
        for name, missing in (
            ("c1", ("bestview", "c0")),
            ("stranger", ("bestview", "c0")),
            ("c0", ("bestview",)),
        ):
            (await by_hand(server.port)).say(f"HELLO 1 {name}\n".encode())
            assert await listener.message() == WaitMessage(missing)
        assert server.pulse is None
        (await by_hand(server.port)).say(b"HELLO 1 bestview\n")
        assert (await listener.beat()).number == 0


async def test_a_client_that_leaves_before_the_first_pulse_is_waited_for_again(by_hand: Connect) -> None:
    async with PulseServer(FPS, expect={"c0", "c1"}, start_timeout=1000.0) as server:
        listener = await by_hand(server.port)
        await listener.message()
        await listener.message()
        gone = await by_hand(server.port)
        gone.say(b"HELLO 1 c0\n")
        assert await listener.message() == WaitMessage(("c1",))
        gone.writer.transport.abort()
        assert await listener.message() == WaitMessage(("c0", "c1"))


async def test_the_server_begins_without_missing_clients_after_the_timeout(
    by_hand: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, "camsync"):
        async with PulseServer(FPS, expect={"c0", "c9"}, start_timeout=0.05) as server:
            listener = await by_hand(server.port)
            listener.say(b"HELLO 1 c0\n")
            assert (await listener.beat()).number == 0
    assert "beginning without c9" in caplog.text


async def test_a_listener_that_closes_its_own_side_still_gets_pulses(by_hand: Connect) -> None:
    async with PulseServer(FPS, expect={"c0"}) as server:
        listener = await by_hand(server.port)
        listener.writer.write_eof()
        (await by_hand(server.port)).say(b"HELLO 1 c0\n")
        assert [(await listener.beat()).number for _ in range(20)] == list(range(20))


async def test_a_late_joiner_gets_the_current_pulse_next(by_hand: Connect) -> None:
    async with PulseServer(FPS) as server:
        early = await by_hand(server.port)
        while (await early.beat()).number < 60:
            pass
        late = await by_hand(server.port)
        greeting = await late.message()
        assert isinstance(greeting, Greeting)
        assert greeting.pulse is not None
        assert (await late.beat()).number == greeting.pulse + 1


async def test_the_server_answers_with_its_clock(by_hand: Connect, jumping_clock: JumpingClock) -> None:
    async with PulseServer(FPS, clock=jumping_clock) as server:
        client = await by_hand(server.port)
        await client.message()
        before = jumping_clock()
        client.say(b"PING 12.5\r\n")
        pong = await client.other()
        assert isinstance(pong, Pong)
        assert pong.sent == 12.5
        assert before - 1e-6 <= pong.now <= jumping_clock() + 1e-6


async def test_a_wrong_line_is_answered_and_the_pulses_go_on(by_hand: Connect) -> None:
    async with PulseServer(FPS) as server:
        client = await by_hand(server.port)
        await client.message()
        client.say(b"GET / HTTP/1.1\nHELLO 9 c0\nHELLO 1 c0\nHELLO 1 c1\n")
        codes = [await client.other() for _ in range(3)]
        assert [error.code for error in codes if isinstance(error, ErrorMessage)] == [
            "malformed",
            "version",
            "malformed",
        ]
        await client.beat()
        (info,) = server.clients()
        assert (info.name, info.errors, info.dropped) == ("c0", 3, 0)


@pytest.mark.parametrize("noise", [b"x" * 100_000, b"x" * 400 + b"\n", b"\n" * 5000, b"PING 1\n" * 5000])
async def test_a_flooding_client_is_closed_and_others_get_all_pulses(by_hand: Connect, noise: bytes) -> None:
    async with PulseServer(FPS, limits=ServerLimits(line_burst=10)) as server:
        quiet, loud = await by_hand(server.port), await by_hand(server.port)
        first = (await quiet.beat()).number
        loud.say(noise)
        await loud.ended()
        numbers = [(await quiet.beat()).number for _ in range(20)]
        assert numbers == list(range(first + 1, first + 21))
        assert len(server.clients()) == 1


async def test_an_overlong_line_is_answered_with_an_error(by_hand: Connect) -> None:
    async with PulseServer(FPS) as server:
        client = await by_hand(server.port)
        await client.beat()
        client.say(b"x" * 257)
        assert b"ERROR overlong" in await client.ended()


async def test_a_second_client_of_a_name_replaces_the_first(by_hand: Connect) -> None:
    async with PulseServer(FPS) as server:
        older = await by_hand(server.port)
        older.say(b"HELLO 1 c0\n")
        await older.beat()
        newer = await by_hand(server.port)
        newer.say(b"HELLO 1 c0\n")
        assert b"ERROR replaced" in await older.ended()
        await newer.beat()
        assert [info.name for info in server.clients()] == ["c0"]


async def test_a_client_that_does_not_read_loses_pulses_and_is_closed(by_hand: Connect) -> None:
    limits = ServerLimits(backlog=16384, cut_off=0.2)
    async with PulseServer(2000.0, limits=limits) as server:
        reads, stuck = await by_hand(server.port), await by_hand(server.port, receive=1)
        stuck.reader._transport.pause_reading()  # type: ignore[attr-defined]
        first = (await reads.beat()).number
        numbers, dropped = [first], 0
        while len(server.clients()) == 2:
            numbers.append((await reads.beat()).number)
            dropped = max(dropped, *(info.dropped for info in server.clients()))
        assert dropped > 0
        assert numbers == list(range(first, numbers[-1] + 1))
        assert server.clients()[0].dropped == 0


async def test_a_vanished_client_is_removed_and_others_get_all_pulses(by_hand: Connect) -> None:
    async with PulseServer(FPS) as server:
        stays = await by_hand(server.port)
        numbers = [(await stays.beat()).number]
        for _ in range(5):
            gone = await by_hand(server.port)
            gone.say(b"HELLO 1 c0\n")
            await gone.beat()
            gone.writer.transport.abort()
        while len(server.clients()) > 1 or len(numbers) < 10:
            numbers.append((await stays.beat()).number)
        assert numbers == list(range(numbers[0], numbers[-1] + 1))


async def test_after_a_long_stall_it_skips_to_the_current_pulse(
    by_hand: Connect, jumping_clock: JumpingClock
) -> None:
    async with PulseServer(FPS, clock=jumping_clock) as server:
        listener = await by_hand(server.port)
        before = await listener.beat()
        jumping_clock.jumped += 3600.0
        numbers = [before.number]
        while numbers[-1] < 3600 * FPS:
            numbers.append((await listener.beat()).number)
        assert len(numbers) < PATIENCE * FPS  # no burst of the 1.4 million in between
        assert server.skipped > 3590 * FPS
        assert (await listener.beat()).number == numbers[-1] + 1


async def test_after_a_short_stall_it_sends_every_pulse(
    by_hand: Connect, jumping_clock: JumpingClock
) -> None:
    async with PulseServer(FPS, clock=jumping_clock, limits=ServerLimits(catch_up=PATIENCE)) as server:
        listener = await by_hand(server.port)
        first = (await listener.beat()).number
        jumping_clock.jumped += 0.2
        numbers = [(await listener.beat()).number for _ in range(150)]
        assert numbers == list(range(first + 1, first + 151))
        assert server.skipped == 0


async def test_the_server_stops_at_max_pulses(by_hand: Connect) -> None:
    async with PulseServer(FPS, expect={"c0"}, max_pulses=20) as server:
        listener = await by_hand(server.port)
        listener.say(b"HELLO 1 c0\n")
        numbers = [(await listener.beat()).number for _ in range(20)]
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
        quiet, quiet_out = await asyncio.open_connection("127.0.0.1", server.port)
        loud, loud_out = await asyncio.open_connection("127.0.0.1", server.port)
        for piece in pieces:
            loud_out.write(piece)
        loud_out.write(b"x" * 257 + b"\n")  # for which it is cut off at the latest
        said = await asyncio.gather(loud.read(-1), return_exceptions=True)
        for line in said[0].splitlines() if isinstance(said[0], bytes) else ():
            assert parse_server_line(line) is not None
        beats = [parse_server_line((await quiet.readline())[:-1]) for _ in range(6)]
        numbers = [message.number for message in beats if isinstance(message, PulseMessage)]
        assert numbers == list(range(numbers[0], numbers[0] + 5))
        for writer in (quiet_out, loud_out):
            writer.transport.abort()
            await asyncio.gather(writer.wait_closed(), return_exceptions=True)
