"""Target for lines of the pulse protocol, valid and damaged, as both sides read them."""

from __future__ import annotations

from random import Random
from typing import Any, cast

from benchmarks.fuzz.engine.mutations import mutate_bytes
from benchmarks.fuzz.engine.target import Target, refused
from camsync.messages import (
    ClientList,
    ClientsRequest,
    CountedPulse,
    ErrorMessage,
    Greeting,
    Hello,
    ListedClient,
    LoginMessage,
    LoginRequest,
    Ping,
    Pong,
    PulseMessage,
    WaitMessage,
)
from camsync.protocol import MAX_LINE, ProtocolError, encode, parse_client_line, parse_server_line

CLIENT_LINES = tuple(
    encode(message)
    for message in (
        Hello("c0"),
        Hello("c1", CountedPulse(123, 0.52)),
        Hello("c0", CountedPulse(2**39, 4.0)),
        Ping(1732159201.5),
        ClientsRequest(),
        LoginMessage("c0", "5b" * 16),
    )
)
SERVER_LINES = tuple(
    encode(message)
    for message in (
        Greeting(1, 25.0, 1000.0, None),
        Greeting(1, 25.0, 1000.0, 7),
        WaitMessage(("c0", "c1")),
        PulseMessage(8, 1000.32),
        PulseMessage(9, 1000.36),
        Pong(1000.0, 1000.01),
        ClientList((ListedClient("c0", 0), ListedClient(None, 7))),
        ErrorMessage("malformed", "say something else"),
        LoginRequest(1000.0),
    )
)
WORDS = (
    b"last=9999999999999", b"ago=999999999999", b"ago=0.0000001", b"fps=999999",
    b"fps=0.00000000000000000001", b"pulse=-", b"now=-999999999999", b"9999999999999", b"-999999999999.9",
    b" ", b"\n", b"\r", b"\x00", b"\xff", b"1e9", b"nan", b"0" * 300, b"x=" * 40, b"HELLO 2 c0\n",
    b"PULSE 99999 1000.4\n", b"ERROR replaced x\n",
)  # fmt: skip


def some_line(rng: Random, lines: tuple[bytes, ...]) -> bytes:
    """Return one of the lines, mostly damaged."""
    line = rng.choice(lines)
    return line if rng.random() < 0.3 else mutate_bytes(rng, line, WORDS)


class ProtocolLines(Target):
    """One line, read by both sides."""

    name = "pulse-lines"

    def make(self, rng: Random) -> bytes:
        """Return a line without its newline."""
        line = some_line(rng, CLIENT_LINES + SERVER_LINES)
        return line.rstrip(b"\n") if rng.random() < 0.9 else rng.randbytes(rng.randrange(60))

    def feed(self, data: bytes) -> bool:
        """Parse the line as the server and as the client; parsed messages can be encoded again."""
        accepted = False
        for parse in (parse_client_line, parse_server_line):
            try:
                message = parse(data[: 16 * MAX_LINE])
            except ProtocolError as error:
                refused(error)
                answer = encode(ErrorMessage(error.code, str(error)))
                assert isinstance(parse_server_line(answer[:-1]), ErrorMessage), answer
            else:
                accepted = message is not None or accepted
                if message is not None:
                    parse(encode(cast("Any", message))[:-1])
        return accepted
