"""Ask a pulse server for its clients."""

from __future__ import annotations

import asyncio
import ssl

from camsync.login import Credentials
from camsync.messages import (
    ClientList,
    ClientsRequest,
    ErrorMessage,
    Greeting,
    ListedClient,
    LoginMessage,
    LoginRequest,
)
from camsync.protocol import MAX_SERVER_LINE, VERSION, ProtocolError, encode, parse_server_line
from camsync.pulse import LoginError, SyncError, VersionError


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
        SyncError: no answer within ``timeout_s`` seconds, no pulse server of this version, or the server
            refuses the login.
    """
    where = f"{host}:{port}"
    try:
        async with asyncio.timeout(timeout_s):
            return await _query(host, port, credentials, tls)
    except TimeoutError as error:
        raise SyncError(f"the pulse server at {where} does not answer") from error
    except ssl.SSLError as error:
        raise SyncError(f"no TLS with the pulse server at {where}: {error.reason or error}") from error
    except OSError as error:
        raise SyncError(f"there is no pulse server at {where}: {error.strerror or error}") from error
    except (ProtocolError, EOFError, ValueError) as error:
        raise SyncError(f"what answers at {where} is no pulse server") from error


async def _query(
    host: str, port: int, credentials: Credentials | None, tls: ssl.SSLContext | None
) -> tuple[ListedClient, ...]:
    reader, writer = await asyncio.open_connection(host, port, limit=MAX_SERVER_LINE, ssl=tls)
    try:
        while True:
            match parse_server_line(await _read_line(reader)):
                case LoginRequest():
                    if credentials is None:
                        raise LoginError(f"the pulse server at {host}:{port} needs a login")
                    writer.write(encode(LoginMessage(credentials.user, credentials.password)))
                case Greeting(version) if version != VERSION:
                    raise VersionError(f"the pulse server at {host}:{port} speaks version {version}")
                case Greeting():
                    writer.write(encode(ClientsRequest()))
                case ErrorMessage(_, text):
                    raise LoginError(f"the pulse server at {host}:{port} refuses: {text}")
                case ClientList(clients):
                    return clients
    finally:
        writer.close()
        await asyncio.gather(writer.wait_closed(), return_exceptions=True)


async def _read_line(reader: asyncio.StreamReader) -> bytes:
    line = await reader.readline()
    if not line:
        raise EOFError
    return line.rstrip(b"\r\n")
