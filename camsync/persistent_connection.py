"""A client's persistent connection to the pulse server: one connection after another, with backoff."""

from __future__ import annotations

import asyncio
import logging
import ssl
from collections.abc import Callable

from camsync.client_types import ClientSettings
from camsync.clock import Clock
from camsync.login import Credentials
from camsync.messages import Hello, ServerLine
from camsync.server_connection import ServerConnection
from expbackoff import Backoff
from logthrottle import LogThrottle

_log = logging.getLogger(__name__)


class PersistentConnection:
    """Connects to the pulse server at ``host:port``, and again after each loss.

    ``hello`` builds the line that opens a connection, ``receive`` gets every message with its time of
    arrival, and ``on_lost`` is called after every connection and every failed attempt.
    """

    def __init__(
        self,
        host: str,
        port: int,
        hello: Callable[[], Hello],
        receive: Callable[[ServerLine, float], None],
        on_lost: Callable[[], None],
        settings: ClientSettings,
        clock: Clock,
        credentials: Credentials | None = None,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        self._host = host
        self._port = port
        self._hello = hello
        self._receive = receive
        self._on_lost = on_lost
        self._settings = settings
        self._clock = clock
        self._credentials = credentials
        self._tls = tls
        self._connection: ServerConnection | None = None
        self._stopped = False
        self._absences = LogThrottle(clock, quiet_s=0.0)
        self.greetings = 0
        """Connections on which the server's greeting was accepted."""

    @property
    def address(self) -> str:
        """``host:port`` of the server."""
        return f"{self._host}:{self._port}"

    @property
    def connected(self) -> bool:
        """Whether the server's greeting was received on the present connection."""
        return self._connection is not None and self._connection.greeted

    async def run(self) -> None:
        """Stay connected until ``stop``; errors that reconnecting cannot solve are raised."""
        backoff = Backoff(self._settings.backoff_first, self._settings.backoff_most)
        while not self._stopped:
            greeted, reason = await self._connect()
            if greeted:
                backoff.reset()
            if not self._stopped and (more := self._absences.record(reason)) is not None:
                _log.warning("pulse server %s is away: %s%s", self.address, reason, more)
            self._on_lost()
            await asyncio.sleep(backoff.next())

    def record_greeting(self, fps: float) -> None:
        """Count a greeting, and log the server's rate after an absence and at the first one."""
        self.greetings += 1
        if (ended := self._absences.end()) or self.greetings == 1:
            rate = f"{fps:g} pulses per second" + (f", after {ended.seconds:.0f} s" if ended else "")
            _log.info("pulse server %s: %s", self.address, rate)

    def stop(self, reason: str) -> None:
        """Close the connection and do not reconnect."""
        self._stopped = True
        if self._connection is not None:
            self._connection.end(reason)

    async def _connect(self) -> tuple[bool, str]:
        """Connect and wait for the end; return whether the server greeted, and why the connection ended."""
        connection = ServerConnection(
            self._receive,
            self._clock,
            self._credentials,
            hello=self._hello,
            ping_interval=self._settings.ping_interval,
            silence=self._settings.silence,
        )
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(self._settings.connect_timeout):
                await loop.create_connection(lambda: connection, self._host, self._port, ssl=self._tls)
            self._connection = connection
            reason = await connection.lost
        except (OSError, TimeoutError) as error:
            reason = str(error) or "no answer"
        finally:
            connection.end("closed")
            self._connection = None
        return connection.greeted, reason
