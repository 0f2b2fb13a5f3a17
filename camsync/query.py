"""Asking a pulse server who its clients are."""

from __future__ import annotations

import asyncio

from camsync.messages import Challenge, Clients, Greeting, Listener, Who
from camsync.proof import Login, NotProvenError, Proof
from camsync.protocol import MAX_SERVER_LINE, VERSION, ProtocolError, encode, parse_server_line
from camsync.pulse import SyncError, VersionError


async def clients_of(
    host: str, port: int, patience: float = 2.0, login: Login | None = None
) -> tuple[Listener, ...]:
    """Give everybody who is connected to the server at ``host:port``, in the order of joining.

    A closed server tells it to who has a ``login``.

    Raises:
        SyncError: nobody answers within ``patience`` seconds, or it is no pulse server of this version, or
            one that asks for another password, or none.
    """
    where = f"{host}:{port}"
    try:
        async with asyncio.timeout(patience):
            return await _ask(host, port, None if login is None else Proof(login))
    except TimeoutError as error:
        raise SyncError(f"the pulse server at {where} does not answer") from error
    except OSError as error:
        raise SyncError(f"there is no pulse server at {where}: {error.strerror or error}") from error
    except NotProvenError as error:
        raise SyncError(f"the pulse server at {where}: {error}") from error
    except (ProtocolError, EOFError, ValueError) as error:
        raise SyncError(f"what answers at {where} is no pulse server") from error


async def _ask(host: str, port: int, proof: Proof | None) -> tuple[Listener, ...]:
    reader, writer = await asyncio.open_connection(host, port, limit=MAX_SERVER_LINE)
    try:
        who = encode(Who())
        if proof is not None:
            who = proof.proven(parse_server_line(await _line(reader))) + proof.sealed(who)
        writer.write(who)
        while True:
            line = await _line(reader)
            match parse_server_line(line if proof is None else proof.opened(line)):
                case Greeting(version) if version != VERSION:
                    raise VersionError(f"the pulse server at {host}:{port} speaks version {version}")
                case Challenge():
                    raise VersionError(f"the pulse server at {host}:{port} asks for a password")
                case Clients(clients):
                    return clients
    finally:
        writer.close()
        await asyncio.gather(writer.wait_closed(), return_exceptions=True)


async def _line(reader: asyncio.StreamReader) -> bytes:
    line = await reader.readline()
    if not line:
        raise EOFError
    return line.rstrip(b"\r\n")
