"""Target for the pulse protocol over TCP: a real server, which keeps serving others, and a real client."""

from __future__ import annotations

import asyncio
import contextlib
from random import Random

from benchmarks.fuzz.engine.event_loops import TimeSkippingLoop, skip_time_wait
from benchmarks.fuzz.engine.target import ScriptTarget, refused
from benchmarks.fuzz.pulses.protocol_lines import CLIENT_LINES, SERVER_LINES, some_line
from camsync import PulseClient, PulseServer, SyncError, query_clients
from camsync.messages import ClientList, ErrorMessage
from camsync.protocol import parse_server_line

_OTHERS_EVERY = 20
_CLIENT_S = 0.25
"""Seconds for which a client reads, and reconnects."""
_HALF_CLOSE_EVERY = 8
"""Half-closed connections occupy a port for a minute."""


class SocketBytes(ScriptTarget):
    """Bytes that are sent to the server, or to a client."""

    name = "pulse-sockets"

    def __init__(self) -> None:
        self._loop = TimeSkippingLoop()
        self._server = PulseServer(25.0, clock=self._loop.time)
        self._loop.run_until_complete(self._server.start())
        self._server_bytes = b""
        self._fake_server = self._loop.run_until_complete(
            asyncio.start_server(self._send_bytes, "127.0.0.1", 0)
        )
        self._count = 0

    def make(self, rng: Random) -> bytes:
        """Return the receiver, and the bytes of a connection."""
        lines = rng.choice((CLIENT_LINES, SERVER_LINES))
        lines_sent = b"".join(some_line(rng, lines) for _ in range(rng.randrange(1, 6)))
        return (b"C" if lines is CLIENT_LINES else b"S") + lines_sent

    def feed(self, data: bytes) -> bool:
        """Send the bytes."""
        send = self._to_server if data[:1] == b"C" else self._to_client
        return self._loop.run_until_complete(send(data[1:]))

    async def _to_server(self, data: bytes) -> bool:
        reader, writer = await asyncio.open_connection("127.0.0.1", self._server.port)
        skip_time_wait(writer.get_extra_info("socket"))
        lines = data + b"\n"
        self.messages += lines.count(b"\n")
        writer.write(lines + b"WHO\n")
        answers = []
        with contextlib.suppress(ConnectionError, TimeoutError):
            # A client with too much unread data is not served.
            async with asyncio.timeout(0.3):
                while line := await reader.readline():
                    answers.append(parse_server_line(line.rstrip(b"\n")))
                    if isinstance(answers[-1], ClientList) or _ended(answers[-1]):
                        break
        writer.transport.abort()
        self._count += 1
        if self._count % _OTHERS_EVERY == 0 or not answers:
            await query_clients("127.0.0.1", self._server.port)
        return not any(isinstance(message, ErrorMessage) for message in answers)

    async def _send_bytes(self, _: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        skip_time_wait(writer.get_extra_info("socket"))
        with contextlib.suppress(OSError):
            writer.write(self._server_bytes)
            await writer.drain()
            if len(self._server_bytes) % _HALF_CLOSE_EVERY == 0:
                writer.write_eof()
            else:
                writer.close()

    async def _to_client(self, data: bytes) -> bool:
        self._server_bytes = data
        self.messages += data.count(b"\n")  # once, even if the client reconnects
        port = self._fake_server.sockets[0].getsockname()[1]
        client = PulseClient("127.0.0.1", port, "c0", clock=self._loop.time)
        client.start()
        try:
            async with asyncio.timeout(_CLIENT_S):
                async for _ in client:
                    pass
        except TimeoutError:
            return client.status().connections > 0
        except SyncError as error:
            return refused(error)
        finally:
            await client.close()
        return True

    def close(self) -> None:
        """Stop the server."""
        self._fake_server.close()
        self._loop.run_until_complete(self._server.stop())
        self._loop.close()


def _ended(message: object) -> bool:
    return isinstance(message, ErrorMessage) and message.code in {"flood", "overlong", "stopped", "full"}
