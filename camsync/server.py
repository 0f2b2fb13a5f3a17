"""The pulse server: frame pulses over TCP (paper section IV.B, the synchronization server)."""

from __future__ import annotations

import asyncio
import logging
import ssl
from collections.abc import Collection, Mapping
from types import TracebackType
from typing import Self

from camsync.client_connection import ClientInfo
from camsync.client_registry import ClientRegistry
from camsync.clock import Clock, steady_unix_clock
from camsync.limits import ServerLimits
from camsync.login import LoginGate
from camsync.messages import Greeting, Hello, PulseMessage, WaitMessage
from camsync.protocol import MAX_FPS, MIN_FPS, VERSION, encode, is_name
from camsync.pulse_schedule import PulseSchedule
from camsync.schedule_claims import MEASUREMENT_ERROR, ScheduleClaims
from logthrottle import LogThrottle

_log = logging.getLogger(__name__)


class PulseServer:
    """Sends pulse n to every client when it is due, at ``epoch + n / fps``, and waits for no client.

    Pulse 0 is sent once all clients named in ``expect`` have sent HELLO, or ``start_timeout`` seconds after
    ``start()`` (at once where that is 0 or no client is expected). A client that joins later gets the next
    pulse.

    The numbers only rise. They skip after the machine was suspended or stalled for more than
    ``limits.catch_up`` (no burst of old pulses), and when enough clients that have counted further reconnect
    to a restarted server, which then continues their count. No single client decides that
    (``schedule_claims``).

    With ``users``, passwords by name, a client has to log in first, and its HELLO must carry its user's name.
    With ``tls`` connections are encrypted; without, passwords can be read on the network.

    ``host`` None listens on all interfaces; ``port`` 0 selects a free one (see ``port``). With ``max_pulses``
    the server stops before that number. Not thread-safe: one event loop.

    Raises:
        ValueError: a rate out of range or an expected name that the protocol cannot carry.
    """

    def __init__(
        self,
        fps: float,
        *,
        expect: Collection[str] = (),
        start_timeout: float = 10.0,
        host: str | None = "127.0.0.1",
        port: int = 0,
        max_pulses: int | None = None,
        limits: ServerLimits | None = None,
        clock: Clock | None = None,
        users: Mapping[str, str] | None = None,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        if not MIN_FPS <= fps <= MAX_FPS:
            raise ValueError(f"fps must be between {MIN_FPS:g} and {MAX_FPS:g}, not {fps}")
        wrong = sorted(name for name in expect if not is_name(name))
        if wrong:
            raise ValueError(f"{wrong[0]!r} cannot be a client's name: letters, digits, '.', '_', '-'")
        self._fps = fps
        self._expect = frozenset(expect)
        self._start_timeout = start_timeout
        self._host = host
        self._port = port
        self._max_pulses = max_pulses
        self._limits = limits or ServerLimits()
        self._clock = clock or steady_unix_clock()
        self._gate = None
        if users is not None or tls is not None:
            self._gate = LoginGate(users, self._limits, self._clock)
        self._registry = ClientRegistry(
            self._clock,
            self._limits,
            self._greet,
            self._on_hello,
            self._on_change,
            self._gate,
            tls,
            self._expect.union(users or ()),
        )
        self._claims = ScheduleClaims(fps, self._expect, self._limits, self._clock)
        self._server: asyncio.Server | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._claims_timer: asyncio.TimerHandle | None = None
        self._schedule: PulseSchedule | None = None
        self._started_at = 0.0
        self._next = 0
        self._pulse: int | None = None
        self._skipped = 0
        self._stalls = LogThrottle(self._clock)
        self._scheduled = asyncio.Event()
        self._ended = asyncio.Event()

    @property
    def fps(self) -> float:
        """Pulses per second."""
        return self._fps

    @property
    def port(self) -> int:
        """The TCP port listened on (0 before ``start()`` if the system is to choose)."""
        sockets = self._server.sockets if self._server else ()
        return int(sockets[0].getsockname()[1]) if sockets else self._port

    @property
    def pulse(self) -> int | None:
        """The last pulse sent; None before the first."""
        return self._pulse

    @property
    def epoch(self) -> float | None:
        """When pulse 0 was due (unix seconds, server clock); None before the first pulse."""
        return self._schedule.epoch if self._schedule else None

    @property
    def skipped(self) -> int:
        """Pulse numbers never sent because the server was stalled or moved its schedule forward."""
        return self._skipped

    @property
    def refused(self) -> int:
        """Connections that failed to log in."""
        return 0 if self._gate is None else self._gate.refused

    def clients(self) -> tuple[ClientInfo, ...]:
        """Return all connected clients, in the order of joining."""
        return self._registry.clients()

    def missing(self) -> tuple[str, ...]:
        """Return the expected names that are not connected, sorted."""
        return tuple(sorted(self._expect - self._registry.names()))

    async def start(self) -> None:
        """Listen.

        Raises:
            OSError: the address cannot be listened on (port in use, no such interface).
        """
        loop = asyncio.get_running_loop()
        try:
            self._server = await loop.create_server(self._registry.new_connection, self._host, self._port)
        except OSError as error:
            where = f"{self._host or '*'}:{self._port}"
            raise OSError(
                error.errno, f"the pulse server cannot listen on {where}: {error.strerror}"
            ) from error
        if self._expect and self._start_timeout > 0.0:
            self._timer = loop.call_later(self._start_timeout, self._begin_without)
        else:
            self._begin()

    async def stop(self) -> None:
        """Stop sending, end all connections, free the port."""
        self._cancel_timer()
        self._cancel_claims_timer()
        self._ended.set()
        if self._server is None:
            return
        self._server.close()
        self._registry.close()
        await self._server.wait_closed()
        self._server = None

    async def wait_scheduled(self) -> None:
        """Return once the first pulse is scheduled."""
        await self._scheduled.wait()

    async def wait_ended(self) -> None:
        """Return once ``max_pulses`` is reached or the server was stopped."""
        await self._ended.wait()

    async def __aenter__(self) -> Self:
        await self.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.stop()

    def _greet(self) -> bytes:
        greeting = encode(Greeting(VERSION, self._fps, self._clock(), self._pulse))
        return greeting if self._schedule else greeting + self._wait_line()

    def _wait_line(self) -> bytes:
        missing = self.missing()
        return encode(WaitMessage(missing)) if missing else b""

    def _on_hello(self, hello: Hello) -> None:
        """Continue the clients' count from before this server was started."""
        if not self._claims.record(hello):
            return
        self._claims.keep_only(self._registry.names())
        if self._schedule is not None:
            self._move_forward(self._schedule)
        elif self._claims_timer is None and self._claims.median_schedule() is not None:
            loop = asyncio.get_running_loop()
            self._claims_timer = loop.call_later(self._limits.claims_for, self._end_claims)

    def _move_forward(self, before: PulseSchedule) -> None:
        now = self._clock()
        if now - self._started_at > self._limits.adopt_for:
            return
        schedule = self._claims.median_schedule(before) or before
        first = schedule.number_at(now) + 1
        if first > before.number_at(now) + MEASUREMENT_ERROR:
            _log.warning("clients have counted to %d: moving forward to that pulse", first - 1)
            self._skipped += max(0, first - self._next)
            self._schedule, self._next = schedule, first
            self._set_timer()
        self._claims.log_claims_ahead(self._schedule or before)

    def _end_claims(self) -> None:
        """Begin with the clients' count, if they are still connected."""
        self._claims_timer = None
        self._claims.keep_only(self._registry.names())
        if self._claims.median_schedule() is not None:
            self._begin()

    def _on_change(self) -> None:
        """Begin if all expected clients are connected; otherwise send the missing names to the clients."""
        if self._schedule is not None or self._ended.is_set():
            return
        line = self._wait_line()
        if line:
            self._registry.broadcast(line)
        else:
            self._begin()

    def _begin_without(self) -> None:
        _log.warning("beginning without %s", ", ".join(self.missing()))
        self._begin()

    def _begin(self) -> None:
        """Begin with pulse 0, or after the pulse that the clients have counted to."""
        self._cancel_claims_timer()
        self._started_at = now = self._clock()
        self._claims.keep_only(self._registry.names())
        agreed = self._claims.median_schedule()
        self._schedule = agreed or PulseSchedule(now, self._fps)
        if agreed is not None:
            self._next = agreed.number_at(now) + 1
            _log.info("clients have counted to %d: continuing from there", self._next - 1)
        self._claims.log_claims_ahead(self._schedule)
        self._scheduled.set()
        self._set_timer()

    def _cancel_claims_timer(self) -> None:
        if self._claims_timer is not None:
            self._claims_timer.cancel()
            self._claims_timer = None

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _set_timer(self) -> None:
        self._cancel_timer()
        if self._schedule is None or self._ended.is_set():
            return
        wait = self._schedule.due(self._next) - self._clock()
        self._timer = asyncio.get_running_loop().call_later(max(0.0, wait), self._tick)

    def _tick(self) -> None:
        """Send the pulses that are due; skip those overdue by more than ``limits.catch_up``."""
        if self._schedule is None:
            return
        now = self._clock()
        current = self._schedule.number_at(now)
        if now - self._schedule.due(self._next) > self._limits.catch_up:
            if (more := self._stalls.record()) is not None:
                _log.warning("late by %d pulses: skipping to %d%s", current - self._next, current, more)
            self._skipped += current - self._next
            self._next = current
        while self._next <= current and not self._reached_end():
            self._registry.send_pulse(encode(PulseMessage(self._next, self._schedule.due(self._next))))
            self._pulse = self._next
            self._next += 1
        self._set_timer()

    def _reached_end(self) -> bool:
        if self._max_pulses is not None and self._next >= self._max_pulses:
            self._ended.set()
        return self._ended.is_set()
