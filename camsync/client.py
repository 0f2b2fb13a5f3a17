"""The pulse client: an asynchronous iterator of pulses that never stops for a missing server."""

from __future__ import annotations

import asyncio
import logging
import ssl
from collections import deque
from types import TracebackType
from typing import Self

from camsync.clock import Clock, steady_unix_clock
from camsync.clock_offset import ClockOffset
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
from camsync.protocol import VERSION, is_name
from camsync.pulse import (
    AxisLostError,
    ClientSettings,
    LoginError,
    Pulse,
    ReplacedError,
    SyncError,
    SyncStatus,
    VersionError,
)
from camsync.pulse_counter import PulseCounter
from camsync.server_connection import ServerConnection
from logthrottle import LogThrottle

_log = logging.getLogger(__name__)
_STALLED = 0.02  # seconds that a timer may be late in a process that runs


class PulseClient:
    """An asynchronous iterator of pulses: numbers rise, each comes at most once.

    ::

        async with PulseClient("sync", 7600, "c0", fps_hint=25.0) as pulses:
            async for pulse in pulses:
                ...

    Connecting says HELLO, that is: ready for frame 0. Open the source first. Until the server has sent a
    pulse there are none (see ``ClientSettings.free_run_after``); from then on, when the server is away or
    silent, the client counts on at the server's rate by its own clock (``Pulse.own``), reconnects by itself,
    and falls back into step. A consumer that is slow loses the oldest pulses and is told how many.

    With ``credentials``, whose user is ``name``, it logs in to a server that asks for it; with ``tls`` the
    server has to prove itself by its certificate.

    ``name`` is 1 to 64 letters, digits, ``.``, ``_``, ``-``; ``fps_hint`` is the rate (pulses per second)
    for counting alone before any server was heard. Not thread-safe: one event loop, one consumer.

    Raises:
        ValueError: a name that the protocol cannot carry or that is not the user's, or a rate not above zero.
        ReplacedError, VersionError, LoginError, AxisLostError: while iterating; only a new client can go on.
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
        self._host = host
        self._port = port
        self._name = name
        self._credentials = credentials
        self._tls = tls
        self._fps = fps_hint
        self._settings = settings or ClientSettings()
        self._clock = clock or steady_unix_clock()
        self._follower = PulseCounter(fps_hint, self._settings.catch_up)
        self._offset = ClockOffset()
        self._queue: deque[Pulse] = deque(maxlen=max(1, self._settings.queue))
        self._wake = asyncio.Event()
        self._link: ServerConnection | None = None
        self._task: asyncio.Task[None] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._failure: SyncError | None = None
        self._closed = False
        self._given: int | None = None
        self._started_at = self._connected_at = self._clock()
        self._missed = self._own = self._connections = 0
        self._waiting_for: tuple[str, ...] = ()
        self._away, self._refused = LogThrottle(self._clock, quiet_s=0.0), LogThrottle(self._clock)

    @property
    def missed(self) -> int:
        """Pulses missed since the first one."""
        return self._missed

    def now(self) -> float:
        """Return the clock of ``Pulse.due`` and ``Pulse.received``: unix seconds that never step."""
        return self._clock()

    def status(self) -> SyncStatus:
        """Return the client's connection status."""
        return SyncStatus(
            connected=self._connected,
            pulse=self._follower.last,
            fps=self._fps,
            offset=self._offset.offset,
            round_trip=self._offset.round_trip,
            missed=self._missed,
            own=self._own,
            connections=self._connections,
            waiting_for=self._waiting_for,
        )

    def start(self) -> None:
        """Begin to connect, in the running event loop; iterating does so too."""
        if self._task is None and not self._closed:
            self._started_at = self._clock()
            self._task = asyncio.create_task(self._stay_connected(), name=f"pulses of {self._name}")
            self._task.add_done_callback(self._connecting_ended)
            self._schedule()

    async def close(self) -> None:
        """Disconnect and end the iteration."""
        self._closed = True
        self._cancel_timer()
        self._wake.set()
        if self._link is not None:
            self._link.end("closed")
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
        missed = 0 if self._given is None else pulse.number - self._given - 1
        self._given = pulse.number
        self._missed += missed
        return Pulse(pulse.number, pulse.due, pulse.received, missed, pulse.own)

    @property
    def _connected(self) -> bool:
        return self._link is not None and self._link.greeted

    async def _stay_connected(self) -> None:
        backoff = self._settings.backoff_first
        while self._failure is None:
            greeted, why = await self._connection()
            if greeted:
                backoff = self._settings.backoff_first
            if self._failure is None and (more := self._away.record(why)) is not None:
                _log.warning("pulse server %s:%d is away: %s%s", self._host, self._port, why, more)
            self._schedule()
            await asyncio.sleep(backoff)
            backoff = min(2.0 * backoff, self._settings.backoff_most)

    async def _connection(self) -> tuple[bool, str]:
        """Connect once and stay; give whether it was a pulse server, and why it ended."""
        settings = self._settings
        pings = settings.ping_interval
        link = ServerConnection(
            self._receive, self._hello, self._clock, pings, settings.silence, self._credentials
        )
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(settings.connect_timeout):
                await loop.create_connection(lambda: link, self._host, self._port, ssl=self._tls)
            self._link = link
            why = await link.lost
        except (OSError, TimeoutError) as error:
            why = str(error) or "no answer"
        finally:
            link.end("closed")
            self._link = None
        return link.greeted, why

    def _hello(self) -> Hello:
        return Hello(self._name, self._follower.known(self._clock()))

    def _receive(self, message: ServerLine, now: float) -> None:
        match message:
            case PulseMessage(number, due):
                self._beat(number, due - (self._offset.offset or 0.0), now)
            case Pong(sent, server):
                self._offset.ponged(sent, server, now)
            case Greeting():
                self._greeted(message, now)
            case LoginRequest():
                self._fail(LoginError("the pulse server needs a login, and this client has none"))
            case WaitMessage(names):
                self._waiting_for = names
            case ErrorMessage(code, text):
                if (more := self._refused.record(text)) is not None:
                    _log.warning("pulse server: %s%s", text, more)
                if code == "replaced":
                    self._fail(ReplacedError(f"{self._name} has given way: {text}"))
                elif code == "version":
                    self._fail(VersionError(text))

    def _greeted(self, greeting: Greeting, now: float) -> None:
        if greeting.version != VERSION:
            self._fail(VersionError(f"the pulse server speaks version {greeting.version}, not {VERSION}"))
            return
        self._connections += 1
        self._connected_at = now
        self._waiting_for = ()
        self._offset.restart()
        self._offset.greeted(greeting.now, now)
        self._fps = greeting.fps
        self._follower.set_rate(greeting.fps)
        if (ended := self._away.end()) or self._connections == 1:
            rate = f"{greeting.fps:g} pulses per second" + (f", after {ended.seconds:.0f} s" if ended else "")
            _log.info("pulse server %s:%d: %s", self._host, self._port, rate)

    def _beat(self, number: int, due: float, now: float) -> None:
        self._waiting_for = ()
        for missing, was_due in self._follower.gap(number, due):
            self._put(missing, was_due, now, own=True)
        if self._follower.heard(number, due):
            self._put(number, due, now, own=False)
        elif self._lost(now):
            self._fail(
                AxisLostError(f"the server is at pulse {number}, {self._name} at {self._follower.last}")
            )
        self._schedule()

    def _lost(self, now: float) -> bool:
        settled = now - self._connected_at > self._settings.settle
        return settled and self._follower.ahead(now) > self._settings.ahead_most

    def _put(self, number: int, due: float, now: float, *, own: bool) -> None:
        self._queue.append(Pulse(number, due, now, 0, own))
        self._own += own
        self._wake.set()

    def _connecting_ended(self, task: asyncio.Task[None]) -> None:
        """Raise in the consumer an error that reconnecting cannot solve (a malformed host name)."""
        error = None if task.cancelled() else task.exception()
        if error is not None:
            self._fail(SyncError(f"cannot connect to {self._host}:{self._port}: {error}"))

    def _fail(self, failure: SyncError) -> None:
        self._failure = failure
        self._cancel_timer()
        self._wake.set()
        if self._link is not None:
            self._link.end(str(failure))

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _schedule(self) -> None:
        """Set the timer for the next own pulse, which the server's next pulse will put off."""
        self._cancel_timer()
        if self._closed or self._failure is not None:
            return
        now = self._clock()
        due = self._follower.next_due()
        if due is not None:
            due += self._settings.own_after if self._connected else 0.0
        elif self._settings.free_run_after is not None and not self._connected:
            due = self._started_at + self._settings.free_run_after
        if due is not None:
            wait = max(0.0, due - now)
            self._timer = asyncio.get_running_loop().call_later(wait, self._count_alone, now + wait)

    def _count_alone(self, planned: float) -> None:
        now = self._clock()
        if now - planned > _STALLED and self._connected:
            # The process was held up, and what the server sent meanwhile may lie unread: read that first.
            self._timer = asyncio.get_running_loop().call_later(0.0, self._count_alone, now)
            return
        if self._follower.next_due() is None:
            self._follower.begin(now)
        late = self._settings.own_after if self._connected else 0.0
        for number, due in self._follower.own(now - late):
            self._put(number, due, now, own=True)
        self._schedule()
