"""A client's connection to the pulse server: lines in, PING out, silence noticed."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import cast

from camsync.clock import Clock
from camsync.lines import LineBuffer, OverlongLineError
from camsync.messages import Challenge, ClientLine, Greeting, Ping, Refusal, ServerLine
from camsync.proof import Login, NotProvenError, Proof
from camsync.protocol import MAX_SERVER_LINE, ProtocolError, encode, parse_server_line

_QUICK_PINGS = 5  # at the beginning, so that the offset is good within a fraction of a second
_QUICK_INTERVAL = 0.05  # seconds between those


class Link(asyncio.Protocol):
    """One connection. ``heard`` gets every message from the greeting on, with its time of arrival.

    ``ping_interval`` is in seconds; after ``silence`` seconds without a byte the server is taken for gone.
    ``hello`` gives the line to open with. With a ``login`` it speaks to a closed server, and to no other.
    """

    def __init__(
        self,
        heard: Callable[[ServerLine, float], None],
        hello: Callable[[], ClientLine],
        clock: Clock,
        ping_interval: float,
        silence: float,
        login: Login | None = None,
    ) -> None:
        self._proof = None if login is None else Proof(login)
        self._heard = heard
        self._hello = hello
        self._clock = clock
        self._ping_interval = ping_interval
        self._silence = silence
        self._lines = LineBuffer(MAX_SERVER_LINE)
        self._transport: asyncio.Transport | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._pings = 0
        self._last_heard = 0.0
        self.greeted = False
        self.lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        """Done when the connection has ended: why, in one sentence."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Say HELLO, begin to ping (called by asyncio)."""
        self._transport = cast("asyncio.Transport", transport)
        self._last_heard = self._clock()
        if self._proof is None:
            self._say(self._hello())
        self._ping()

    def data_received(self, data: bytes) -> None:
        """Pass on what the server says (called by asyncio)."""
        self._last_heard = now = self._clock()
        try:
            for line in self._lines.feed(data):
                self._take(line, now)
                if self.lost.done():
                    return
        except (ProtocolError, OverlongLineError) as error:
            self.end(f"it does not speak the pulse protocol ({error})")
        except NotProvenError as error:
            self.end(str(error))

    def connection_lost(self, exc: Exception | None) -> None:
        """Note the end (called by asyncio)."""
        self._transport = None
        self.end(str(exc) if exc else "the server closed the connection")

    def end(self, why: str) -> None:
        """Cut the connection."""
        if self._timer is not None:
            self._timer.cancel()
        if not self.lost.done():
            self.lost.set_result(why)
        if self._transport is not None:
            self._transport.abort()

    def _take(self, line: bytes, now: float) -> None:
        if self._proof is not None:
            if not self._proof.begun:
                self._prove(self._proof, line)
                return
            line = self._proof.opened(line)
        message = parse_server_line(line)
        if isinstance(message, Greeting):
            self.greeted = True
        elif not self.greeted and not isinstance(message, Refusal | Challenge):
            raise ProtocolError("malformed", "the first line is not a greeting")
        if message is not None:
            self._heard(message, now)

    def _prove(self, proof: Proof, line: bytes) -> None:
        proving = proof.proven(parse_server_line(line))
        if self._transport is not None:
            self._transport.write(proving)
            self._say(self._hello())

    def _say(self, message: ClientLine) -> None:
        if self._transport is not None:
            line = encode(message)
            self._transport.write(line if self._proof is None else self._proof.sealed(line))

    def _ping(self) -> None:
        now = self._clock()
        if self._transport is None:
            return
        if now - self._last_heard > self._silence:
            self.end(f"nothing heard for {self._silence:g} seconds")
            return
        if self._proof is None or self._proof.begun:
            self._say(Ping(now))
        self._pings += 1
        wait = _QUICK_INTERVAL if self._pings < _QUICK_PINGS else self._ping_interval
        self._timer = asyncio.get_running_loop().call_later(min(wait, self._ping_interval), self._ping)
