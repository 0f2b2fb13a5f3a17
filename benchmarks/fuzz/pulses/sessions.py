"""Targets for sessions of the pulse server and client, without sockets."""

from __future__ import annotations

import asyncio
from random import Random

import msgspec

from benchmarks.fuzz.engine.target import ScriptTarget
from benchmarks.fuzz.pulses.fake_connection import FakeWriter, ManualClock
from benchmarks.fuzz.pulses.protocol_lines import CLIENT_LINES, SERVER_LINES, some_line
from camsync import ClientSettings, PulseClient, PulseServer
from camsync.protocol import parse_client_line, parse_server_line
from camsync.server_connection import ServerConnection
from server.messaging.number_types import Pulse

_pulse = msgspec.json.Decoder(Pulse)
Script = list[tuple[int, bytes]]
"""The number of a connection, and bytes that it sends in one piece."""
_script = msgspec.msgpack.Decoder(Script)


def _scripted(rng: Random, lines: tuple[bytes, ...], connections: int) -> bytes:
    script: Script = []
    for _ in range(rng.randrange(1, 10)):
        line = some_line(rng, lines)
        at = rng.randrange(len(line) + 1) if rng.random() < 0.2 else len(line)
        number = rng.randrange(connections)
        script += [(number, part) for part in (line[:at], line[at:]) if part]
    return msgspec.msgpack.encode(script)


class ServerSessions(ScriptTarget):
    """Three connections to a server, which must keep to its protocol with all of them."""

    name = "pulse-server"

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()

    def make(self, rng: Random) -> bytes:
        """Return a script of messages."""
        return _scripted(rng, CLIENT_LINES, 3)

    def feed(self, data: bytes) -> bool:
        """Send the messages, then let a second pass."""
        return self._loop.run_until_complete(self._session(_script.decode(data)))

    async def _session(self, script: Script) -> bool:
        clock = ManualClock()
        server = PulseServer(25.0, expect=("c0",), clock=clock)
        hub = server._registry
        wires = [FakeWriter() for _ in range(3)]
        peers = [hub.new_connection() for _ in wires]
        for peer, wire in zip(peers, wires, strict=True):
            peer.connection_made(wire)
        for number, data in script:
            if not wires[number].closed:
                self.messages += data.count(b"\n")
                peers[number].data_received(data)
            clock.now += 0.01
        server._begin_without() if server.epoch is None else None
        for _ in range(3):
            clock.now += 0.04
            server._tick()
        errors = sum(client.errors for client in server.clients())
        for wire in wires:
            self._check_sent_lines(wire)
        if server.pulse is not None:
            _pulse.decode(str(server.pulse).encode())  # a number that cameras can send back
        await server.stop()
        for peer in peers:
            peer.connection_lost(None)
        return errors == 0 and not any(wire.closed for wire in wires)

    @staticmethod
    def _check_sent_lines(wire: FakeWriter) -> None:
        for line in wire.lines:
            assert parse_server_line(line) is not None, line

    def close(self) -> None:
        """Close the loop."""
        self._loop.close()


class ClientSessions(ScriptTarget):
    """A client with a hostile server: pulse numbers rise, and it ends with a clear error or continues."""

    name = "pulse-client"

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()

    def make(self, rng: Random) -> bytes:
        """Return the server's messages, mostly after a valid greeting."""
        if rng.random() < 0.8:
            first: Script = [(0, rng.choice(SERVER_LINES[:2]))]
            return msgspec.msgpack.encode([*first, *_script.decode(_scripted(rng, SERVER_LINES, 1))])
        return _scripted(rng, SERVER_LINES, 1)

    def feed(self, data: bytes) -> bool:
        """Send one line, then wait a second."""
        return self._loop.run_until_complete(self._session(_script.decode(data)))

    async def _session(self, script: Script) -> bool:
        clock = ManualClock()
        client = PulseClient("nowhere", 1, "c0", settings=ClientSettings(queue=10_000), clock=clock)
        link = ServerConnection(client._receive, clock, hello=client._hello, ping_interval=1.0, silence=5.0)
        client._server._connection = link
        wire = FakeWriter()
        link.connection_made(wire)
        for _, data in script:
            if not wire.closed:
                self.messages += data.count(b"\n")
                link.data_received(data)
            clock.now += 0.01
        for _ in range(3):
            clock.now += 0.2
            client._make_local_pulses(clock.now)
        for line in wire.written.splitlines():
            parse_client_line(line)
        client.status()
        client._hello()
        numbers = [pulse.number for pulse in client._queue]
        assert numbers == sorted(set(numbers)), "pulse numbers must rise"
        link.end("over")
        client._cancel_timer()
        return "protocol" not in link.lost.result()

    def close(self) -> None:
        """Close the loop."""
        self._loop.close()
