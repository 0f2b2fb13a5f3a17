"""The wire format: messages survive encoding and parsing, and any other bytes are an error."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camsync.lines import LineBuffer, OverlongLineError, RateLimit
from camsync.messages import (
    ClientLine,
    ClientList,
    ClientsRequest,
    CountedPulse,
    ErrorMessage,
    Greeting,
    Hello,
    ListedClient,
    Ping,
    Pong,
    PulseMessage,
    ServerLine,
    WaitMessage,
)
from camsync.protocol import MAX_LINE, ProtocolError, encode, is_name, parse_client_line, parse_server_line

names = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", fullmatch=True)
numbers = st.integers(0, 10**12)
# A line carries microseconds; whole ones up to this size are exact in a float.
times = st.integers(-(10**15), 10**15).map(lambda micro: micro / 1e6)
durations = st.integers(0, 10**12).map(lambda micro: micro / 1e6)
rates = st.floats(0.01, 10_000).map(lambda fps: float(f"{fps:.12f}"))
client_lines = st.one_of(
    st.builds(Hello, names, st.none() | st.builds(CountedPulse, numbers, durations)),
    st.builds(Ping, times),
    st.just(ClientsRequest()),
)
server_lines = st.one_of(
    st.builds(Greeting, st.just(1), rates, times, st.none() | numbers),
    st.builds(WaitMessage, st.lists(names, min_size=1, max_size=5).map(tuple)),
    st.builds(PulseMessage, numbers, times),
    st.builds(Pong, times, times),
    st.builds(
        ClientList,
        st.lists(st.builds(ListedClient, st.none() | names, st.integers(0, 10**6)), max_size=5).map(tuple),
    ),
    st.builds(ErrorMessage, st.just("malformed"), st.just("two words")),
)


@settings(deadline=None, max_examples=60)
@given(client_lines)
def test_client_messages_survive_encoding_and_parsing(message: ClientLine) -> None:
    line = encode(message)
    assert line.endswith(b"\n")
    assert len(line) <= MAX_LINE
    assert parse_client_line(line[:-1]) == message


@settings(deadline=None, max_examples=60)
@given(server_lines)
def test_server_messages_survive_encoding_and_parsing(message: ServerLine) -> None:
    line = encode(message)
    assert line.isascii()
    assert line.count(b"\n") == 1
    assert parse_server_line(line[:-1]) == message


words = st.sampled_from(
    [b"HELLO", b"PING", b"WHO", b"PULSE", b"MYVIEW-SYNC", b"WAIT", b"PONG", b"CLIENTS", b"ERROR", b"1", b"-1"]
)
tails = st.sampled_from([b"last=3", b"ago=-1", b"fps=0", b"fps=25", b"now=nan", b"pulse=-", b"1e400", b"inf"])
almost_lines = st.lists(words | tails | st.binary(max_size=8), max_size=6).map(b" ".join)


@settings(deadline=None, max_examples=300)
@given(almost_lines | st.binary(max_size=MAX_LINE))
def test_any_bytes_are_a_message_or_a_protocol_error(line: bytes) -> None:
    for parse in (parse_client_line, parse_server_line):
        with contextlib.suppress(ProtocolError):
            parse(line)


@settings(deadline=None, max_examples=60)
@given(almost_lines | st.binary(max_size=MAX_LINE))
def test_the_answer_to_any_bytes_is_one_readable_line(line: bytes) -> None:
    try:
        parse_client_line(line)
    except ProtocolError as error:
        answer = encode(ErrorMessage(error.code, str(error)))
        assert answer.decode("ascii").rstrip("\n").isprintable()
        assert isinstance(parse_server_line(answer[:-1]), ErrorMessage)


@pytest.mark.parametrize(
    ("line", "code"),
    [
        (b"", "malformed"),
        (b"HELLO", "malformed"),
        (b"HELLO 2 c0", "version"),
        (b"HELLO 1 c/0", "malformed"),
        (b"HELLO 1 c0 last=-1", "malformed"),
        (b"HELLO 1 c0 last=1 ago=-2", "malformed"),
        (b"PING nan", "malformed"),
        (b"PING \xff", "malformed"),
        (b"GET / HTTP/1.1", "malformed"),
    ],
)
def test_a_wrong_line_is_refused_with_a_code(line: bytes, code: str) -> None:
    with pytest.raises(ProtocolError) as caught:
        parse_client_line(line)
    assert caught.value.code == code


@pytest.mark.parametrize("fps", [b"0", b"0.0000000000000001", b"10000.5", b"999999"])
def test_an_impossible_rate_in_a_greeting_is_refused(fps: bytes) -> None:
    with pytest.raises(ProtocolError):
        parse_server_line(b"MYVIEW-SYNC 1 fps=" + fps + b" now=0 pulse=-")


def test_unknown_words_of_a_later_version_are_ignored() -> None:
    assert parse_server_line(b"TEMPERATURE 21") is None
    assert parse_client_line(b"HELLO 1 c0 color=blue") == Hello("c0")
    assert parse_server_line(b"MYVIEW-SYNC 1 fps=25 now=0 pulse=- color=blue") == Greeting(1, 25.0, 0.0, None)


def test_a_greeting_of_another_version_keeps_its_version() -> None:
    greeting = parse_server_line(b"MYVIEW-SYNC 7 rate:25")
    assert isinstance(greeting, Greeting)
    assert greeting.version == 7


def test_a_name_is_one_word_of_at_most_64_characters() -> None:
    assert is_name("c0")
    assert not is_name("")
    assert not is_name("two words")
    assert not is_name("x" * 65)
    assert not is_name("c0\n")


@settings(deadline=None, max_examples=60)
@given(st.lists(st.binary(max_size=20).filter(lambda line: b"\n" not in line)), st.integers(1, 7))
def test_lines_do_not_depend_on_how_the_bytes_are_split(lines: list[bytes], step: int) -> None:
    data = b"".join(line + b"\r\n" for line in lines)
    buffer = LineBuffer(limit=32)
    received = [line for at in range(0, len(data), step) for line in buffer.feed(data[at : at + step])]
    assert received == lines


@settings(deadline=None, max_examples=60)
@given(st.integers(1, 200))
def test_a_line_without_end_is_refused_before_it_fills_memory(step: int) -> None:
    buffer = LineBuffer(limit=100)
    for _ in range(100 // step):
        assert list(buffer.feed(b"x" * step)) == []
    with pytest.raises(OverlongLineError):
        list(buffer.feed(b"x" * step))


def test_a_burst_is_allowed_and_a_flood_is_not() -> None:
    rate = RateLimit(burst=3, rate=1, now=0.0)
    assert [rate.take(0.0) for _ in range(4)] == [True, True, True, False]
    assert rate.take(1.0)
    assert not rate.take(1.0)
    assert [rate.take(100.0) for _ in range(4)] == [True, True, True, False]
