"""The pulse protocol: its lines, whole sessions of server and client without sockets, and over real ones."""

from __future__ import annotations

import asyncio
import contextlib
from random import Random
from typing import Any, cast

import msgspec

from benchmarks.fuzz_mutate import damaged
from benchmarks.fuzz_target import Target, refused
from camsync import ClientSettings, PulseClient, PulseServer, SyncError, clients_of
from camsync.link import Link
from camsync.messages import Beat, Clients, Greeting, Hello, Known, Listener, Ping, Pong, Refusal, Wait, Who
from camsync.protocol import MAX_LINE, ProtocolError, encode, parse_client_line, parse_server_line
from server.wire.messages import Pulse

CLIENT_LINES = tuple(
    encode(it)
    for it in (
        Hello("c0"),
        Hello("c1", Known(123, 0.52)),
        Hello("c0", Known(2**39, 4.0)),
        Ping(1732159201.5),
        Who(),
    )
)
SERVER_LINES = tuple(
    encode(it)
    for it in (
        Greeting(1, 25.0, 1000.0, None),
        Greeting(1, 25.0, 1000.0, 7),
        Wait(("c0", "c1")),
        Beat(8, 1000.32),
        Beat(9, 1000.36),
        Pong(1000.0, 1000.01),
        Clients((Listener("c0", 0), Listener(None, 7))),
        Refusal("malformed", "say something else"),
    )
)
WORDS = (
    b"last=9999999999999", b"ago=999999999999", b"ago=0.0000001", b"fps=999999",
    b"fps=0.00000000000000000001", b"pulse=-", b"now=-999999999999", b"9999999999999", b"-999999999999.9",
    b" ", b"\n", b"\r", b"\x00", b"\xff", b"1e9", b"nan", b"0" * 300, b"x=" * 40, b"HELLO 2 c0\n",
    b"PULSE 99999 1000.4\n", b"ERROR replaced x\n",
)  # fmt: skip

_pulse = msgspec.json.Decoder(Pulse)
Script = list[tuple[int, bytes]]
"""Who says what: the number of a connection, and bytes in one piece."""
_script = msgspec.msgpack.Decoder(Script)


def _line(rng: Random, lines: tuple[bytes, ...]) -> bytes:
    line = rng.choice(lines)
    return line if rng.random() < 0.3 else damaged(rng, line, WORDS)


class Lines(Target):
    """One line, as both sides read it."""

    name = "pulse-lines"

    def make(self, rng: Random) -> bytes:
        """Give a line without its end."""
        line = _line(rng, CLIENT_LINES + SERVER_LINES)
        return line.rstrip(b"\n") if rng.random() < 0.9 else rng.randbytes(rng.randrange(60))

    def feed(self, data: bytes) -> bool:
        """Read it as the server does, and as the client does; what is read can be said again."""
        taken = False
        for parse in (parse_client_line, parse_server_line):
            try:
                message = parse(data[: 16 * MAX_LINE])
            except ProtocolError as error:
                refused(error)
                answer = encode(Refusal(error.code, str(error)))
                assert isinstance(parse_server_line(answer[:-1]), Refusal), answer
            else:
                taken = message is not None or taken
                if message is not None:
                    parse(encode(cast("Any", message))[:-1])
        return taken


class _Clock:
    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


class _Wire(asyncio.Transport):
    """Keeps what is written instead of sending it."""

    def __init__(self) -> None:
        super().__init__()
        self.written = b""
        self.closed = False

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.written += bytes(data)

    def get_write_buffer_size(self) -> int:
        return 0

    def is_closing(self) -> bool:
        return self.closed

    def close(self) -> None:
        self.closed = True

    abort = close

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        return _NoSocket() if name == "socket" else ("client", id(self)) if name == "peername" else default


class _NoSocket:
    def setsockopt(self, *_: object) -> None:
        """Have no options."""


def _scripted(rng: Random, lines: tuple[bytes, ...], connections: int) -> bytes:
    script: Script = []
    for _ in range(rng.randrange(1, 10)):
        line = _line(rng, lines)
        at = rng.randrange(len(line) + 1) if rng.random() < 0.2 else len(line)
        who = rng.randrange(connections)
        script += [(who, part) for part in (line[:at], line[at:]) if part]
    return msgspec.msgpack.encode(script)


class ServerSessions(Target):
    """Three connections to a server, which must go on to speak its own protocol to them all."""

    name = "pulse-server"
    share = 0.5

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()

    def make(self, rng: Random) -> bytes:
        """Give who says what."""
        return _scripted(rng, CLIENT_LINES, 3)

    def feed(self, data: bytes) -> bool:
        """Let them say it; then let a second pass."""
        return self._loop.run_until_complete(self._session(_script.decode(data)))

    async def _session(self, script: Script) -> bool:
        clock = _Clock()
        server = PulseServer(25.0, expect=("c0",), clock=clock)
        hub = server._hub
        wires = [_Wire() for _ in range(3)]
        peers = [hub.new_peer() for _ in wires]
        for peer, wire in zip(peers, wires, strict=True):
            peer.connection_made(wire)
        for who, said in script:
            if not wires[who].closed:
                peers[who].data_received(said)
            clock.now += 0.01
        server._begin_without() if server.epoch is None else None
        for _ in range(3):
            clock.now += 0.04
            server._tick()
        errors = sum(it.errors for it in server.clients())
        for wire in wires:
            self._spoken(wire.written)
        if server.pulse is not None:
            _pulse.decode(str(server.pulse).encode())  # a number that cameras can say in turn
        await server.stop()
        for peer in peers:
            peer.connection_lost(None)
        return errors == 0 and not any(wire.closed for wire in wires)

    @staticmethod
    def _spoken(written: bytes) -> None:
        *lines, rest = written.split(b"\n")
        assert not rest, rest
        for line in lines:
            assert parse_server_line(line) is not None, line

    def close(self) -> None:
        """Close the loop."""
        self._loop.close()


class ClientSessions(Target):
    """A client that is told anything by its server: numbers rise, and it ends in words or goes on."""

    name = "pulse-client"
    share = 0.5

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()

    def make(self, rng: Random) -> bytes:
        """Give what the server says, mostly after a greeting that is right."""
        if rng.random() < 0.8:
            first: Script = [(0, rng.choice(SERVER_LINES[:2]))]
            return msgspec.msgpack.encode([*first, *_script.decode(_scripted(rng, SERVER_LINES, 1))])
        return _scripted(rng, SERVER_LINES, 1)

    def feed(self, data: bytes) -> bool:
        """Say it; then let a second pass."""
        return self._loop.run_until_complete(self._session(_script.decode(data)))

    async def _session(self, script: Script) -> bool:
        clock = _Clock()
        client = PulseClient("nowhere", 1, "c0", settings=ClientSettings(queue=10_000), clock=clock)
        link = Link(client._heard, client._hello, clock, 1.0, 5.0)
        client._link = link
        wire = _Wire()
        link.connection_made(wire)
        for _, said in script:
            if not wire.closed:
                link.data_received(said)
            clock.now += 0.01
        for _ in range(3):
            clock.now += 0.2
            client._count_alone(clock.now)
        for line in wire.written.splitlines():
            parse_client_line(line)
        client.status()
        client._hello()
        numbers = [it.number for it in client._queue]
        assert numbers == sorted(set(numbers)), "pulses go back"
        link.end("over")
        client._cancel_timer()
        return "protocol" not in link.lost.result()

    def close(self) -> None:
        """Close the loop."""
        self._loop.close()


class Sockets(Target):
    """The same over TCP: a real server, which answers others meanwhile, and a real client."""

    name = "pulse-sockets"
    share = 0.01

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._server = PulseServer(25.0)
        self._loop.run_until_complete(self._server.start())
        self._fed = 0

    def make(self, rng: Random) -> bytes:
        """Give what a connection says, to the server or to a client."""
        lines = rng.choice((CLIENT_LINES, SERVER_LINES))
        said = b"".join(_line(rng, lines) for _ in range(rng.randrange(1, 6)))
        return (b"C" if lines is CLIENT_LINES else b"S") + said

    def feed(self, data: bytes) -> bool:
        """Say it."""
        said = self._to_server if data[:1] == b"C" else self._to_client
        return self._loop.run_until_complete(said(data[1:]))

    async def _to_server(self, data: bytes) -> bool:
        reader, writer = await asyncio.open_connection("127.0.0.1", self._server.port)
        writer.write(data + b"\nWHO\n")
        heard = []
        with contextlib.suppress(ConnectionError, TimeoutError):
            # Who has left too much unread is not told who is there.
            async with asyncio.timeout(0.3):
                while line := await reader.readline():
                    heard.append(parse_server_line(line.rstrip(b"\n")))
                    if isinstance(heard[-1], Clients) or _ended(heard[-1]):
                        break
        writer.transport.abort()
        self._fed += 1
        if self._fed % 20 == 0 or not heard:
            await clients_of("127.0.0.1", self._server.port)
        return not any(isinstance(it, Refusal) for it in heard)

    async def _to_client(self, data: bytes) -> bool:
        async def serve(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            with contextlib.suppress(OSError):
                writer.write(data)
                await writer.drain()
                writer.write_eof()

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        client = PulseClient("127.0.0.1", server.sockets[0].getsockname()[1], "c0")
        client.start()
        try:
            async with asyncio.timeout(0.03):
                async for _ in client:
                    pass
        except TimeoutError:
            return client.status().connections > 0
        except SyncError as error:
            return refused(error)
        finally:
            await client.close()
            server.close()
        return True

    def close(self) -> None:
        """Stop the server."""
        self._loop.run_until_complete(self._server.stop())
        self._loop.close()


def _ended(message: object) -> bool:
    return isinstance(message, Refusal) and message.code in {"flood", "overlong", "stopped", "full"}


TARGETS = (Lines, ServerSessions, ClientSessions, Sockets)
