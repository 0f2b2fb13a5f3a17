"""Query of a pulse server for its clients."""

from __future__ import annotations

import asyncio
import ssl

from camsync.client_types import LoginError, SyncError, VersionError
from camsync.clock import steady_unix_clock
from camsync.login import Credentials
from camsync.messages import (
    ClientList,
    ClientsRequest,
    ErrorMessage,
    Greeting,
    ListedClient,
    LoginRequest,
    ServerLine,
)
from camsync.protocol import VERSION
from camsync.server_connection import ServerConnection


async def query_clients(
    host: str,
    port: int,
    timeout_s: float = 2.0,
    *,
    credentials: Credentials | None = None,
    tls: ssl.SSLContext | None = None,
) -> tuple[ListedClient, ...]:
    """Return the clients of the server at ``host:port``, in the order of joining.

    Raises:
        SyncError: no answer within ``timeout_s`` seconds, or no pulse server.
        VersionError: the server speaks another version.
        LoginError: the server needs a login, or refuses this one.
    """
    address = f"{host}:{port}"
    query = _ClientQuery(address, credentials)
    connection = query.connection
    try:
        async with asyncio.timeout(timeout_s):
            await asyncio.get_running_loop().create_connection(lambda: connection, host, port, ssl=tls)
            return await query.answer
    except TimeoutError as error:
        raise SyncError(f"the pulse server at {address} does not answer") from error
    except ssl.SSLError as error:
        raise SyncError(f"no TLS with the pulse server at {address}: {error.reason or error}") from error
    except OSError as error:
        raise SyncError(f"there is no pulse server at {address}: {error.strerror or error}") from error
    except ValueError as error:  # a malformed host name
        raise SyncError(f"what answers at {address} is no pulse server") from error
    finally:
        query.answer.cancel()
        connection.end("closed")


class _ClientQuery:
    """One request for the list of clients, over a separate connection."""

    def __init__(self, address: str, credentials: Credentials | None) -> None:
        self._address = address
        self.connection = ServerConnection(self._receive, steady_unix_clock(), credentials)
        self.connection.lost.add_done_callback(self._on_lost)
        self.answer: asyncio.Future[tuple[ListedClient, ...]] = asyncio.get_running_loop().create_future()

    def _on_lost(self, _lost: asyncio.Future[str]) -> None:
        if not self.answer.done():
            self.answer.set_exception(SyncError(f"what answers at {self._address} is no pulse server"))

    def _receive(self, message: ServerLine, _received: float) -> None:
        if self.answer.done():
            return
        server = f"the pulse server at {self._address}"
        match message:
            case LoginRequest():
                self.answer.set_exception(LoginError(f"{server} needs a login"))
            case Greeting(version) if version != VERSION:
                self.answer.set_exception(VersionError(f"{server} speaks version {version}"))
            case Greeting():
                self.connection.send(ClientsRequest())
            case ErrorMessage(_, text):
                self.answer.set_exception(LoginError(f"{server} refuses: {text}"))
            case ClientList(clients):
                self.answer.set_result(clients)
