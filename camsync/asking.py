"""Asking a pulse server who its clients are."""

from __future__ import annotations

import asyncio

from camsync.messages import Clients, Greeting, Listener, Who
from camsync.protocol import MAX_SERVER_LINE, VERSION, ProtocolError, encode, parse_server_line
from camsync.pulse import SyncError, VersionError


async def clients_of(host: str, port: int, patience: float = 2.0) -> tuple[Listener, ...]:
    """Give everybody who is connected to the server at ``host:port``, in the order of joining.

    Raises:
        SyncError: nobody answers within ``patience`` seconds, or it is no pulse server of this version.
    """
    where = f"{host}:{port}"
    try:
        async with asyncio.timeout(patience):
            return await _ask(host, port)
    except TimeoutError as error:
        raise SyncError(f"the pulse server at {where} does not answer") from error
    except OSError as error:
        raise SyncError(f"there is no pulse server at {where}: {error.strerror or error}") from error
    except (ProtocolError, EOFError, ValueError) as error:
        raise SyncError(f"what answers at {where} is no pulse server") from error


async def _ask(host: str, port: int) -> tuple[Listener, ...]:
    reader, writer = await asyncio.open_connection(host, port, limit=MAX_SERVER_LINE)
    try:
        writer.write(encode(Who()))
        while True:
            line = await reader.readline()
            if not line:
                raise EOFError
            match parse_server_line(line.rstrip(b"\r\n")):
                case Greeting(version) if version != VERSION:
                    raise VersionError(f"the pulse server at {host}:{port} speaks version {version}")
                case Clients(clients):
                    return clients
    finally:
        writer.close()
        await asyncio.gather(writer.wait_closed(), return_exceptions=True)
