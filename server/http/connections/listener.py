"""Listener: accepts connections that the connection limiter admits, before TLS and before reading.

Neither asyncio nor aiohttp limits the number of connections, or the time until a request is complete.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
import ssl
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import ExitStack, asynccontextmanager, suppress
from typing import Any

from aiohttp import web

from logthrottle import LogThrottle
from server.http.connections.connection_limiter import Connection, ConnectionLimiter
from server.http.periodic import run_periodically
from server.system.accept_errors import AcceptErrors

log = logging.getLogger(__name__)

_BACKLOG = 128
"""Connections that the kernel queues until they are accepted."""
_OVERDUE_EVERY_S = 1.0
_ACCEPT_RETRY_S = 0.5
"""Pause after accept(2) failed."""
_NO_SUCH_ADDRESS = frozenset({errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT})
"""Errors of addresses to skip: localhost is also ::1, but not every machine has IPv6."""
_TLS_SHUTDOWN_S = 2.0
"""Limit of the time for the TLS shutdown."""


class PooledHandler(web.RequestHandler):
    """The protocol of a connection; it reports the connection's state to the limiter."""

    __slots__ = ("connection", "pool")

    def __init__(
        self, pool: ConnectionLimiter, connection: Connection, server: web.Server, **settings: Any
    ) -> None:
        super().__init__(server, loop=asyncio.get_running_loop(), **settings)
        self.pool, self.connection = pool, connection

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take over the transport (called by asyncio after the TLS handshake)."""
        assert isinstance(transport, asyncio.Transport)  # noqa: S101 — TCP and TLS transports are
        self.connection.transport = transport
        super().connection_made(transport)

    def connection_lost(self, exc: BaseException | None) -> None:
        """Report the connection as closed (called by asyncio)."""
        super().connection_lost(exc)
        self.pool.closed(self.connection)

    async def finish_response(
        self, request: web.BaseRequest, resp: web.StreamResponse, start_time: float | None
    ) -> tuple[web.StreamResponse, bool]:
        """Send an answer (called by aiohttp)."""
        self.pool.sending(self.connection)
        try:
            return await super().finish_response(request, resp, start_time)
        finally:
            self.pool.idle(self.connection)

    def body_pending(self) -> None:
        """Report that the body of a request is still to come."""
        self.pool.receiving(self.connection)

    def body_received(self) -> None:
        """Report that the body of a request is complete."""
        self.pool.busy(self.connection)


class _AcceptedSocket:
    """An accepted socket, and the task that creates its transport."""

    def __init__(self, sock: socket.socket) -> None:
        self.socket = sock
        self.task: asyncio.Task[None] | None = None
        self.started = False
        """Whether asyncio has taken over the socket and will close it."""

    def abort(self) -> None:
        """Close it."""
        if self.task is not None:
            self.task.cancel()
        if not self.started:
            self.socket.close()

    def get_write_buffer_size(self) -> int:
        """Return 0: nothing has been written."""
        return 0


class Listener:
    """Accepts the connections of a server that the limiter admits; ``settings`` go to each handler."""

    def __init__(
        self, server: web.Server, pool: ConnectionLimiter, tls: ssl.SSLContext | None, **settings: Any
    ) -> None:
        self._pool, self._tls = pool, tls
        self._server, self._settings = server, settings
        self._accept_errors, self._full = AcceptErrors(), LogThrottle()
        self._accepted: set[asyncio.Task[None]] = set()

    @asynccontextmanager
    async def listening(self, host: str, port: int) -> AsyncIterator[int]:
        """Accept connections inside; yield the port.

        Raises:
            OSError: the address cannot be listened on.
        """
        with ExitStack() as sockets:
            opened = [sockets.enter_context(listening) for listening in await _listen(host, port)]
            loops = [
                run_periodically(0.0, self._accept_from(listening), "accepting connections")
                for listening in opened
            ]
            loops.append(
                run_periodically(_OVERDUE_EVERY_S, self._close_overdue, "closing overdue connections")
            )
            tasks = [asyncio.create_task(loop, name="connections") for loop in loops]
            try:
                yield int(opened[0].getsockname()[1])
            finally:
                await _cancel([*tasks, *self._accepted])

    def _accept_from(self, listening: socket.socket) -> Callable[[], Coroutine[Any, Any, None]]:
        async def accept() -> None:
            try:
                # No await until the socket has an owner: a cancellation would leak it.
                sock, address = listening.accept()
            except BlockingIOError:
                await _readable(listening)
                return
            except ConnectionAbortedError:
                return  # the client has closed it already
            except OSError as error:
                self._accept_errors.failed(error)
                self._pool.evict_waiting()
                await asyncio.sleep(_ACCEPT_RETRY_S)
                return
            sock.setblocking(False)  # noqa: FBT003 — clear from the method's name
            self._accept_socket(sock, str(address[0]))

        return accept

    def _accept_socket(self, sock: socket.socket, address: str) -> None:
        accepted = _AcceptedSocket(sock)
        connection = self._pool.admit(address, accepted)
        if connection is None or connection.is_reserved:
            self._log_full()
        if connection is None:
            sock.close()
            return
        accepted.task = asyncio.create_task(self._open(accepted, connection), name="connection")
        self._accepted.add(accepted.task)
        accepted.task.add_done_callback(lambda task: self._done(task, accepted, connection))

    def _done(self, task: asyncio.Task[None], accepted: _AcceptedSocket, connection: Connection) -> None:
        self._accepted.discard(task)
        if not accepted.started:  # cancelled before it ran
            accepted.socket.close()
            self._pool.closed(connection)

    async def _open(self, accepted: _AcceptedSocket, connection: Connection) -> None:
        accepted.started = True
        timeout = self._pool.limits.request_s
        limits = {"ssl_handshake_timeout": timeout, "ssl_shutdown_timeout": min(timeout, _TLS_SHUTDOWN_S)}
        try:
            await asyncio.get_running_loop().connect_accepted_socket(
                lambda: PooledHandler(self._pool, connection, self._server, **self._settings),
                accepted.socket,
                ssl=self._tls,
                **({} if self._tls is None else limits),
            )
        except OSError as error:  # also of the TLS handshake
            log.debug("connection could not be established: %s", error)
            self._pool.closed(connection)
        except BaseException:
            self._pool.closed(connection)
            raise

    async def _close_overdue(self) -> None:
        self._pool.close_overdue()

    def _log_full(self) -> None:
        if (more := self._full.record()) is not None:
            log.warning(
                "all connections (http.connections_max %d, http.connections_per_address %d) are busy: "
                "only operators are admitted%s",
                self._pool.limits.most,
                self._pool.limits.per_address,
                more,
            )


async def _listen(host: str, port: int) -> list[socket.socket]:
    """Listen on all addresses of a host name that this machine has."""
    resolved = await asyncio.get_running_loop().getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )
    opened: list[socket.socket] = []
    skipped: OSError | None = None
    for family, address in dict.fromkeys((info[0], info[4]) for info in resolved):
        try:
            opened.append(_listening(family, address))
        except OSError as error:
            if error.errno not in _NO_SUCH_ADDRESS:
                for listening in opened:
                    listening.close()
                raise
            skipped = error
    if not opened and skipped is not None:
        raise skipped
    return opened


def _listening(family: socket.AddressFamily, address: tuple[Any, ...]) -> socket.socket:
    listening = socket.socket(family, socket.SOCK_STREAM)
    try:
        listening.setblocking(False)  # noqa: FBT003 — clear from the method's name
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if family is socket.AF_INET6:  # another process may listen on 0.0.0.0
            listening.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        listening.bind(address)
        listening.listen(_BACKLOG)
    except OSError:
        listening.close()
        raise
    return listening


async def _readable(listening: socket.socket) -> None:
    """Wait until a connection can be accepted."""
    loop = asyncio.get_running_loop()
    readable = asyncio.Event()
    loop.add_reader(listening, readable.set)
    try:
        await readable.wait()
    finally:
        loop.remove_reader(listening)


async def _cancel(tasks: list[asyncio.Task[Any]]) -> None:
    for task in tasks:
        task.cancel()
    with suppress(asyncio.CancelledError):
        await asyncio.gather(*tasks, return_exceptions=True)
