"""Target for a pulse server with access control: clients without a login send arbitrary bytes."""

from __future__ import annotations

import asyncio
from random import Random

import msgspec

from benchmarks.fuzz.engine.mutations import mutate_bytes
from benchmarks.fuzz.engine.target import ScriptTarget
from benchmarks.fuzz.pulses.fake_connection import FakeWriter, ManualClock
from benchmarks.fuzz.pulses.protocol_lines import CLIENT_LINES, WORDS, some_line
from camsync import Credentials, PulseServer
from camsync.messages import ClientsRequest, ErrorMessage, Hello, LoginMessage, LoginRequest, Ping
from camsync.protocol import encode, parse_server_line

_LOGIN = Credentials("c0", "right" * 8)
_USERS = {"c0": _LOGIN.password, "c1": "other" * 8}
_Said = list[bytes]
_said = msgspec.msgpack.Decoder(_Said)


def _guessed_login(rng: Random) -> bytes:
    """Return the login of a guessing client, and its next message."""
    user = rng.choice(("c0", "c1", "bestview"))
    wrong = [word for word in (*_USERS.values(), "wrong", _LOGIN.password[:-1]) if word != _USERS.get(user)]
    return encode(LoginMessage(user, rng.choice(wrong))) + rng.choice(CLIENT_LINES)


class UnauthenticatedClients(ScriptTarget):
    """Two unauthenticated clients learn nothing, and do not disturb an authenticated one."""

    name = "pulse-unauthenticated"

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()

    def make(self, rng: Random) -> bytes:
        """Return the messages that they send in turn."""
        ways = (
            lambda: some_line(rng, CLIENT_LINES),
            lambda: _guessed_login(rng),
            lambda: mutate_bytes(rng, _guessed_login(rng), WORDS),
        )
        return msgspec.msgpack.encode([rng.choice(ways)() for _ in range(rng.randrange(1, 6))])

    def feed(self, data: bytes) -> bool:
        """Send the messages, with pulses in between."""
        return self._loop.run_until_complete(self._session(_said.decode(data)))

    async def _session(self, script: _Said) -> bool:
        clock = ManualClock()
        server = PulseServer(25.0, expect=("c0", "c1"), clock=clock, users=_USERS)
        wires = [FakeWriter() for _ in range(3)]
        peers = [server._registry.new_connection() for _ in wires]
        for peer, wire in zip(peers, wires, strict=True):
            peer.connection_made(wire)
        peers[0].data_received(encode(LoginMessage(_LOGIN.user, _LOGIN.password)) + encode(Hello("c0")))
        for place, said in enumerate(script):
            who = 1 + place % 2
            if not wires[who].closed:
                self.messages += said.count(b"\n")
                peers[who].data_received(said)
            clock.now += 0.01
        assert server.missing() == ("c1",), "a stranger was let in"
        server._begin_without()
        for _ in range(3):
            clock.now += 0.04
            server._tick()
        peers[0].data_received(encode(Ping(1.0)) + encode(ClientsRequest()))
        kinds = [type(parse_server_line(line)).__name__ for line in wires[0].lines[1:]]
        assert kinds == [
            "Greeting",
            "WaitMessage",
            "WaitMessage",
            *["PulseMessage"] * 3,
            "Pong",
            "ClientList",
        ], kinds
        assert [client.name for client in server.clients()] == ["c0"]
        for wire in wires[1:]:
            first, *others = map(parse_server_line, wire.lines)
            assert isinstance(first, LoginRequest)
            assert all(isinstance(other, ErrorMessage) for other in others), others
            assert len(others) <= 1, others
        refused = server.refused
        await server.stop()
        return refused == 0

    def close(self) -> None:
        """Close the loop."""
        self._loop.close()
