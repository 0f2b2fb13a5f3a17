"""Listening: each connection has a place before anything is read of it, and before HTTPS begins.

Neither asyncio nor aiohttp bounds how many there are, or how long one may take to ask for something.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
import ssl
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from contextlib import ExitStack, asynccontextmanager, contextmanager, suppress
from typing import Any

from aiohttp import web

from logthrottle import LogThrottle
from server.http.connections.connection_pool import Connection, Places
from server.http.periodic import again_and_again
from server.system.accept_errors import AcceptErrors

log = logging.getLogger(__name__)

_BACKLOG = 128
"""Connections that wait in the system to be accepted."""
_OVERDUE_EVERY_S = 1.0
_FAILED_PAUSE_S = 0.5
"""After one could not be accepted."""
_NOT_HERE = frozenset({errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT})
"""What a name may stand for besides: localhost is ::1, too, and not every machine speaks IPv6."""
_GOODBYE_S = 2.0
"""How long HTTPS may take to end in good order."""


class Handler(web.RequestHandler):
    """A connection's protocol, which knows its place."""

    __slots__ = ("connection", "places")

    def __init__(self, places: Places, connection: Connection, server: web.Server, **settings: Any) -> None:
        super().__init__(server, loop=asyncio.get_running_loop(), **settings)
        self.places, self.connection = places, connection

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin (called by asyncio), after HTTPS has."""
        assert isinstance(transport, asyncio.Transport)  # noqa: S101 — tells mypy that it can be written to
        self.connection.wire = transport
        super().connection_made(transport)

    def connection_lost(self, exc: BaseException | None) -> None:
        """Free the place (called by asyncio)."""
        super().connection_lost(exc)
        self.places.left(self.connection)

    async def finish_response(
        self, request: web.BaseRequest, resp: web.StreamResponse, start_time: float | None
    ) -> tuple[web.StreamResponse, bool]:
        """Send an answer (called by aiohttp)."""
        self.places.is_sent(self.connection)
        try:
            return await super().finish_response(request, resp, start_time)
        finally:
            self.places.rests(self.connection)


@contextmanager
def still_coming(request: web.Request) -> Iterator[None]:
    """Read what follows a request's head inside: until it has come, the connection asks for nothing yet."""
    handler = request.protocol
    if not isinstance(handler, Handler):
        yield
        return
    handler.places.waits(handler.connection)
    try:
        yield
    finally:
        handler.places.asks(handler.connection)


class _Opening:
    """What becomes a transport: a socket, and the task that makes one of it."""

    def __init__(self, sock: socket.socket) -> None:
        self.socket = sock
        self.task: asyncio.Task[None] | None = None
        self.begun = False
        """From then on asyncio closes the socket."""

    def abort(self) -> None:
        """Give it up."""
        if self.task is not None:
            self.task.cancel()
        if not self.begun:
            self.socket.close()

    def get_write_buffer_size(self) -> int:
        """Return that nothing waits."""
        return 0


class Listener:
    """Accepts connections for a server, as far as there are places; ``settings`` are its handlers'."""

    def __init__(
        self, server: web.Server, places: Places, tls: ssl.SSLContext | None, **settings: Any
    ) -> None:
        self._places, self._tls = places, tls
        self._server, self._settings = server, settings
        self._failing, self._full = AcceptErrors(), LogThrottle()
        self._opening: set[asyncio.Task[None]] = set()

    @asynccontextmanager
    async def listening(self, host: str, port: int) -> AsyncIterator[int]:
        """Accept connections inside; give the port.

        Raises:
            OSError: the address cannot be listened on.
        """
        with ExitStack() as sockets:
            opened = [sockets.enter_context(it) for it in await _opened(host, port)]
            turns = [again_and_again(0.0, self._accepting(it), "accepting connections") for it in opened]
            turns.append(
                again_and_again(_OVERDUE_EVERY_S, self._look, "looking for connections that ask for nothing")
            )
            tasks = [asyncio.create_task(it, name="connections") for it in turns]
            try:
                yield int(opened[0].getsockname()[1])
            finally:
                await _cancelled([*tasks, *self._opening])

    def _accepting(self, listening: socket.socket) -> Callable[[], Coroutine[Any, Any, None]]:
        async def accept() -> None:
            try:
                # Nothing is awaited until somebody looks after it: else it could be lost at the end.
                sock, address = listening.accept()
            except BlockingIOError:
                await _knocked(listening)
                return
            except ConnectionAbortedError:
                return  # it has gone again
            except OSError as error:
                self._failing.failed(error)
                self._places.make_way()
                await asyncio.sleep(_FAILED_PAUSE_S)
                return
            sock.setblocking(False)  # noqa: FBT003 — the name of the method says it
            self._take(sock, str(address[0]))

        return accept

    def _take(self, sock: socket.socket, address: str) -> None:
        opening = _Opening(sock)
        connection = self._places.admit(address, opening)
        if connection is None or connection.beyond:
            self._say_full()
        if connection is None:
            sock.close()
            return
        opening.task = asyncio.create_task(self._open(opening, connection), name="connection")
        self._opening.add(opening.task)
        opening.task.add_done_callback(lambda task: self._opened(task, opening, connection))

    def _opened(self, task: asyncio.Task[None], opening: _Opening, connection: Connection) -> None:
        self._opening.discard(task)
        if not opening.begun:  # it was cancelled before
            opening.socket.close()
            self._places.left(connection)

    async def _open(self, opening: _Opening, connection: Connection) -> None:
        opening.begun = True
        patience = self._places.bounds.request_s
        limits = {"ssl_handshake_timeout": patience, "ssl_shutdown_timeout": min(patience, _GOODBYE_S)}
        try:
            await asyncio.get_running_loop().connect_accepted_socket(
                lambda: Handler(self._places, connection, self._server, **self._settings),
                opening.socket,
                ssl=self._tls,
                **({} if self._tls is None else limits),
            )
        except OSError as error:  # those of HTTPS among them
            log.debug("a connection did not begin: %s", error)
            self._places.left(connection)
        except BaseException:
            self._places.left(connection)
            raise

    async def _look(self) -> None:
        self._places.cut_off_overdue()

    def _say_full(self) -> None:
        if (more := self._full.record()) is not None:
            log.warning(
                "all connections that are taken (http.connections_max %d, http.connections_per_address %d) "
                "are busy: operators alone get in%s",
                self._places.bounds.most,
                self._places.bounds.per_address,
                more,
            )


async def _opened(host: str, port: int) -> list[socket.socket]:
    """Listen on all addresses that a host's name stands for, as far as this machine has them."""
    found = await asyncio.get_running_loop().getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )
    opened: list[socket.socket] = []
    lacking: OSError | None = None
    for family, address in dict.fromkeys((it[0], it[4]) for it in found):
        try:
            opened.append(_listening(family, address))
        except OSError as error:
            if error.errno not in _NOT_HERE:
                for it in opened:
                    it.close()
                raise
            lacking = error
    if not opened and lacking is not None:
        raise lacking
    return opened


def _listening(family: socket.AddressFamily, address: tuple[Any, ...]) -> socket.socket:
    listening = socket.socket(family, socket.SOCK_STREAM)
    try:
        listening.setblocking(False)  # noqa: FBT003 — the name of the method says it
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if family is socket.AF_INET6:  # :: is not also 0.0.0.0, which another may have
            listening.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        listening.bind(address)
        listening.listen(_BACKLOG)
    except OSError:
        listening.close()
        raise
    return listening


async def _knocked(listening: socket.socket) -> None:
    """Wait until somebody wants to be let in."""
    loop = asyncio.get_running_loop()
    knocked = asyncio.Event()
    loop.add_reader(listening, knocked.set)
    try:
        await knocked.wait()
    finally:
        loop.remove_reader(listening)


async def _cancelled(tasks: list[asyncio.Task[Any]]) -> None:
    for task in tasks:
        task.cancel()
    with suppress(asyncio.CancelledError):
        await asyncio.gather(*tasks, return_exceptions=True)
