"""Pulses with passwords: strangers say anything, and somebody sits between a client and its server."""

from __future__ import annotations

import asyncio
from random import Random
from unittest.mock import patch

import msgspec

from benchmarks.fuzz.mutate import damaged
from benchmarks.fuzz.pulse_lines import CLIENT_LINES, WORDS, some_line
from benchmarks.fuzz.pulse_wire import Clock, Wire
from benchmarks.fuzz.target import Scripts
from camsync import ClientSettings, Login, PulseClient, PulseServer
from camsync.link import Link
from camsync.messages import Beat, Challenge, Greeting, Hello, Ping, Refusal, ServerLine, Who
from camsync.proof import Proof
from camsync.protocol import encode, parse_server_line
from camsync.seal import Seals

_LOGIN = Login("c0", "right" * 8)
_USERS = {"c0": _LOGIN.password, "c1": "other" * 8}
_NONCES = ("1" * 32, "2" * 32)
_BEATS = 8
_Said = list[bytes]
_said = msgspec.msgpack.Decoder(_Said)


def _overheard(rng: Random) -> bytes:
    """Give what a client that is let in says, on another connection: all but its password is known."""
    seals = Seals.of(_LOGIN.password, "c0", (f"{rng.getrandbits(128):032x}", _NONCES[1]))
    lines = seals.client.sealed(f"PROVE c0 nonce={_NONCES[1]}\n".encode() + b"".join(CLIENT_LINES[:3]))
    return b"".join(rng.sample(lines.splitlines(keepends=True), rng.randrange(1, 5)))


def _guessed(rng: Random, nonce: str) -> bytes:
    """Give what a client says that has another password."""
    password = rng.choice((*_USERS.values(), "", "wrong", _LOGIN.password[:-1]))
    user = rng.choice(("c0", "c1", "bestview"))
    right = user in _USERS and _USERS[user] == password
    seals = Seals.of("wrong" if right else password, user, (nonce, _NONCES[1]))
    return seals.client.sealed(f"PROVE {user} nonce={_NONCES[1]}\n".encode() + rng.choice(CLIENT_LINES))


class Strangers(Scripts):
    """Two strangers at a closed server: they are told nothing, and who has the password notices nothing."""

    name = "pulse-strangers"

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._foreseen = patch("camsync.door.new_nonce", return_value=_NONCES[0])  # by who overhears, at best

    def make(self, rng: Random) -> bytes:
        """Give what they say in turn."""
        ways = (
            lambda: some_line(rng, CLIENT_LINES),
            lambda: _overheard(rng),
            lambda: _guessed(rng, _NONCES[0]),
            lambda: damaged(rng, _guessed(rng, _NONCES[0]), WORDS),
        )
        return msgspec.msgpack.encode([rng.choice(ways)() for _ in range(rng.randrange(1, 6))])

    def feed(self, data: bytes) -> bool:
        """Let them say it, with pulses in between."""
        with self._foreseen:
            return self._loop.run_until_complete(self._session(_said.decode(data)))

    async def _session(self, script: _Said) -> bool:
        clock = Clock()
        server = PulseServer(25.0, expect=("c0", "c1"), clock=clock, users=_USERS)
        wires = [Wire() for _ in range(3)]
        peers = [server._hub.new_peer() for _ in wires]
        for peer, wire in zip(peers, wires, strict=True):
            peer.connection_made(wire)
        proof = Proof(_LOGIN)
        peers[0].data_received(
            proof.proven(Challenge(_NONCES[0], clock())) + proof.sealed(encode(Hello("c0")))
        )
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
        peers[0].data_received(proof.sealed(encode(Ping(1.0)) + encode(Who())))
        kinds = [type(parse_server_line(proof.opened(line))).__name__ for line in wires[0].lines[1:]]
        assert kinds == ["Greeting", "Wait", "Wait", *["Beat"] * 3, "Pong", "Clients"], kinds
        assert [it.name for it in server.clients()] == ["c0"]
        for wire in wires[1:]:
            first, *others = map(parse_server_line, wire.lines)
            assert isinstance(first, Challenge)
            assert all(isinstance(it, Refusal) for it in others), others
            assert len(others) <= 1, others
        refused = server.refused
        await server.stop()
        return refused == 0

    def close(self) -> None:
        """Close the loop."""
        self._loop.close()


class Between(Scripts):
    """What a server says is tampered with on its way: the client believes the pulses before that alone."""

    name = "pulse-between"

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._foreseen = patch("camsync.proof.new_nonce", return_value=_NONCES[1])
        seals = Seals.of(_LOGIN.password, "c0", _NONCES)
        beats = [Beat(number, 1000.0 + number / 25) for number in range(_BEATS)]
        lines: tuple[ServerLine, ...] = (Greeting(1, 25.0, 1000.0, None), *beats)
        said = b"".join(map(encode, lines))
        self._right = seals.server.sealed(said).splitlines(keepends=True)

    def make(self, rng: Random) -> bytes:
        """Give what arrives, line by line."""
        lines = list(self._right)
        for _ in range(rng.choice((0, 1, 1, 1, 2))):
            place = rng.randrange(len(lines))
            match rng.randrange(5):
                case 0:
                    lines[place] = damaged(rng, lines[place], WORDS)
                case 1:
                    lines.insert(place, rng.choice(lines))
                case 2:
                    lines[place : place + 1] = [] if len(lines) > 1 else [b"\n"]
                case 3:
                    lines.insert(place, encode(Beat(rng.randrange(10**6), 1000.0)))
                case _:
                    other = rng.randrange(len(lines))
                    lines[place], lines[other] = lines[other], lines[place]
        return msgspec.msgpack.encode(lines)

    def feed(self, data: bytes) -> bool:
        """Let it arrive."""
        with self._foreseen:
            return self._loop.run_until_complete(self._session(_said.decode(data)))

    async def _session(self, lines: _Said) -> bool:
        clock = Clock()
        settings = ClientSettings(queue=10_000)
        client = PulseClient("nowhere", 1, "c0", settings=settings, clock=clock, login=_LOGIN)
        link = Link(client._heard, client._hello, clock, 1.0, 5.0, _LOGIN)
        client._link = link
        wire = Wire()
        link.connection_made(wire)
        link.data_received(encode(Challenge(_NONCES[0], 1000.0)))
        for line in lines:
            if not wire.closed:
                self.messages += line.count(b"\n")
                link.data_received(line)
        whole = b"".join(lines).split(b"\n")[:-1]
        right = [line[:-1] for line in self._right]
        same = 0
        while same < min(len(whole), len(right)) and whole[same].removesuffix(b"\r") == right[same]:
            same += 1
        believed = [it.number for it in client._queue if not it.own]
        assert believed == list(range(max(0, same - 1))), (believed, same)
        assert wire.closed == (same < len(whole)), "what is not believed ends the connection"
        link.end("over")
        client._cancel_timer()
        return same == len(whole)

    def close(self) -> None:
        """Close the loop."""
        self._loop.close()
