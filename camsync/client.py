"""The pulse client: an asynchronous iterator of pulses that continues while the server is away."""

from __future__ import annotations

import asyncio
import logging
import ssl
from collections import deque
from types import TracebackType
from typing import Self

from camsync.client_types import (
    ClientSettings,
    LoginError,
    Pulse,
    ReplacedError,
    ScheduleLostError,
    SyncError,
    SyncStatus,
    VersionError,
)
from camsync.clock import Clock, ClockOffset, steady_unix_clock
from camsync.login import Credentials
from camsync.messages import (
    ErrorMessage,
    Greeting,
    Hello,
    LoginRequest,
    Pong,
    PulseMessage,
    ServerLine,
    WaitMessage,
)
from camsync.persistent_connection import PersistentConnection
from camsync.protocol import VERSION, is_name
from camsync.pulse_schedule import PulseCounter
from logthrottle import LogThrottle

_log = logging.getLogger(__name__)
_STALLED = 0.02  # seconds; a timer that is later than this means that the process was stalled


class PulseClient:
    """An asynchronous iterator of pulses: numbers rise, each comes at most once.

    ::

        async with PulseClient("sync", 7600, "c0", fps_hint=25.0) as pulses:
            async for pulse in pulses:
                ...

    Connecting sends HELLO, which means: ready for frame 0. Open the source first. Before the server's first
    pulse the iterator yields none (see ``ClientSettings.free_run_after``). Afterwards, while the server is
    away or silent, the client generates pulses at the server's rate (``Pulse.local``), reconnects, and
    continues with the server's count. A slow consumer loses the oldest pulses; ``Pulse.missed`` counts them.

    With ``credentials``, whose user is ``name``, it logs in to a server that requires it; with ``tls`` it
    checks the server's certificate.

    ``name`` is 1 to 64 letters, digits, ``.``, ``_``, ``-``; ``fps_hint`` is the rate (pulses per second)
    of a client that has not reached a server yet. Not thread-safe: one event loop, one consumer.

    Raises:
        ValueError: a name that the protocol cannot carry or that is not the user's, or a rate not above zero.
        SyncError: while iterating, for a reason that reconnecting cannot solve: ReplacedError, VersionError,
            LoginError, ScheduleLostError, or a malformed host name.
    """

    def __init__(
        self,
        host: str,
        port: int,
        name: str,
        *,
        fps_hint: float = 25.0,
        settings: ClientSettings | None = None,
        clock: Clock | None = None,
        credentials: Credentials | None = None,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        if not is_name(name) or (credentials is not None and credentials.user != name):
            raise ValueError(f"{name!r} cannot be a client's name: letters, digits, '.', '_', '-'")
        if not fps_hint > 0.0:
            raise ValueError(f"fps_hint must be above zero, not {fps_hint}")
        self._name = name
        self._fps = fps_hint
        self._settings = settings or ClientSettings()
        self._clock = clock or steady_unix_clock()
        self._counter = PulseCounter(fps_hint, self._settings.catch_up)
        self._offset = ClockOffset()
        self._queue: deque[Pulse] = deque(maxlen=max(1, self._settings.queue))
        self._wake = asyncio.Event()
        self._server = PersistentConnection(
            host,
            port,
            self._hello,
            self._receive,
            self._set_timer,
            self._settings,
            self._clock,
            credentials,
            tls,
        )
        self._task: asyncio.Task[None] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._failure: SyncError | None = None
        self._closed = False
        self._last_number: int | None = None
        self._started_at = self._greeted_at = self._clock()
        self._missed = self._local_pulses = 0
        self._waiting_for: tuple[str, ...] = ()
        self._server_errors = LogThrottle(self._clock)

    @property
    def missed(self) -> int:
        """Pulses missed since the first one."""
        return self._missed

    def client_now(self) -> float:
        """Return the time on the client's own clock, that of ``Pulse.due``, in unix seconds."""
        return self._clock()

    def status(self) -> SyncStatus:
        """Return the client's connection status."""
        return SyncStatus(
            connected=self._server.connected,
            pulse=self._counter.last,
            fps=self._fps,
            offset=self._offset.offset,
            round_trip=self._offset.round_trip,
            missed=self._missed,
            local_pulses=self._local_pulses,
            connections=self._server.greetings,
            waiting_for=self._waiting_for,
        )

    def start(self) -> None:
        """Start connecting, in the running event loop; iterating does so too."""
        if self._task is None and not self._closed:
            self._started_at = self._clock()
            self._task = asyncio.create_task(self._server.run(), name=f"pulses of {self._name}")
            self._task.add_done_callback(self._on_connecting_ended)
            self._set_timer()

    async def close(self) -> None:
        """Disconnect and end the iteration."""
        self._closed = True
        self._cancel_timer()
        self._wake.set()
        self._server.stop("closed")
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def __aenter__(self) -> Self:
        self.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    def __aiter__(self) -> Self:
        self.start()
        return self

    async def __anext__(self) -> Pulse:
        self.start()
        while not self._queue:
            if self._failure is not None:
                raise self._failure
            if self._closed:
                raise StopAsyncIteration
            self._wake.clear()
            await self._wake.wait()
        pulse = self._queue.popleft()
        missed = 0 if self._last_number is None else pulse.number - self._last_number - 1
        self._last_number = pulse.number
        self._missed += missed
        return Pulse(pulse.number, pulse.due, pulse.received, missed, pulse.local)

    def _hello(self) -> Hello:
        return Hello(self._name, self._counter.known(self._clock()))

    def _receive(self, message: ServerLine, now: float) -> None:
        match message:
            case PulseMessage(number, due):
                self._accept_pulse(number, due - (self._offset.offset or 0.0), now)
            case Pong(sent, server):
                self._offset.ponged(sent, server, now)
            case Greeting():
                self._accept_greeting(message, now)
            case LoginRequest():
                self._fail(LoginError("the pulse server needs a login, and this client has none"))
            case WaitMessage(names):
                self._waiting_for = names
            case ErrorMessage(code, text):
                if (more := self._server_errors.record(text)) is not None:
                    _log.warning("pulse server: %s%s", text, more)
                if code == "replaced":
                    self._fail(ReplacedError(f"{self._name} was replaced: {text}"))
                elif code == "version":
                    self._fail(VersionError(text))

    def _accept_greeting(self, greeting: Greeting, now: float) -> None:
        if greeting.version != VERSION:
            self._fail(VersionError(f"the pulse server speaks version {greeting.version}, not {VERSION}"))
            return
        self._greeted_at = now
        self._waiting_for = ()
        self._offset.restart()
        self._offset.greeted(greeting.now, now)
        self._fps = greeting.fps
        self._counter.set_rate(greeting.fps)
        self._server.record_greeting(greeting.fps)

    def _accept_pulse(self, number: int, due: float, now: float) -> None:
        self._waiting_for = ()
        for missing, was_due in self._counter.fill_gap(number, due):
            self._put(missing, was_due, now, local=True)
        if self._counter.accept(number, due):
            self._put(number, due, now, local=False)
        elif self._schedule_lost(now):
            self._fail(
                ScheduleLostError(f"the server is at pulse {number}, {self._name} at {self._counter.last}")
            )
        self._set_timer()

    def _schedule_lost(self, now: float) -> bool:
        settled = now - self._greeted_at > self._settings.settle
        return settled and self._counter.ahead(now) > self._settings.ahead_most

    def _put(self, number: int, due: float, now: float, *, local: bool) -> None:
        self._queue.append(Pulse(number, due, now, 0, local))
        self._local_pulses += local
        self._wake.set()

    def _on_connecting_ended(self, task: asyncio.Task[None]) -> None:
        """Raise in the consumer an error that reconnecting cannot solve (a malformed host name)."""
        error = None if task.cancelled() else task.exception()
        if error is not None:
            self._fail(SyncError(f"cannot connect to {self._server.address}: {error}"))

    def _fail(self, failure: SyncError) -> None:
        self._failure = failure
        self._cancel_timer()
        self._wake.set()
        self._server.stop(str(failure))

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _set_timer(self) -> None:
        """Set the timer for the next local pulse; each pulse from the server resets it."""
        self._cancel_timer()
        if self._closed or self._failure is not None:
            return
        now = self._clock()
        due = self._counter.next_due()
        if due is not None:
            due += self._settings.local_after if self._server.connected else 0.0
        elif self._settings.free_run_after is not None and not self._server.connected:
            due = self._started_at + self._settings.free_run_after
        if due is not None:
            wait = max(0.0, due - now)
            self._timer = asyncio.get_running_loop().call_later(wait, self._make_local_pulses, now + wait)

    def _make_local_pulses(self, planned: float) -> None:
        now = self._clock()
        if now - planned > _STALLED and self._server.connected:
            # The process was stalled, and pulses may wait unread in the socket: read them first.
            self._timer = asyncio.get_running_loop().call_later(0.0, self._make_local_pulses, now)
            return
        if self._counter.next_due() is None:
            self._counter.start_at(now)
        late = self._settings.local_after if self._server.connected else 0.0
        for number, due in self._counter.count_local(now - late):
            self._put(number, due, now, local=True)
        self._set_timer()
