"""An RTSP client over one TCP connection, which also pauses."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fakes.rtsp.gateway import RunningGateway

_INTERLEAVED = b"$"
_VIDEO_CHANNEL = 0
_MARKER = 0x80
"""In the second byte of an RTP packet: the last of a picture."""


class RtspClient:
    """Requests, and the pictures that are sent between the answers."""

    def __init__(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, address: str, login: str
    ) -> None:
        self._reader, self._writer, self._address, self._login = reader, writer, address, login
        self._session: list[str] = []
        self._answers: asyncio.Queue[str] = asyncio.Queue()
        self.pictures = 0
        """Whole pictures that have come."""

    async def request(self, method: str, *lines: str, path: str = "") -> str:
        """Send a request; return the answer's head."""
        head = [f"{method} {self._address}{path} RTSP/1.0", "CSeq: 1", self._login, *self._session, *lines]
        self._writer.write("\r\n".join([*head, "", ""]).encode())
        answer = await self._answers.get()
        assert answer.startswith("RTSP/1.0 200"), answer
        return answer

    async def set_up(self) -> None:
        """Ask for the video on this connection."""
        await self.request("DESCRIBE")
        answer = await self.request(
            "SETUP", "Transport: RTP/AVP/TCP;unicast;interleaved=0-1", path="/stream=0"
        )
        self._session = [
            line.partition(";")[0] for line in answer.splitlines() if line.startswith("Session:")
        ]

    async def tear_down(self) -> None:
        """End the session, but not the connection."""
        await self.request("TEARDOWN")
        self._session = []

    async def read(self) -> None:
        """Read what comes until the connection ends."""
        while first := await self._reader.read(1):
            if first == _INTERLEAVED:
                channel, size = struct.unpack(">BH", await self._reader.readexactly(3))
                packet = await self._reader.readexactly(size)
                if channel == _VIDEO_CHANNEL:
                    self.pictures += bool(packet[1] & _MARKER)
            else:
                head = (first + await self._reader.readuntil(b"\r\n\r\n")).decode()
                for line in head.splitlines():
                    if line.startswith("Content-Length:"):
                        await self._reader.readexactly(int(line.split()[1]))
                self._answers.put_nowait(head)


@asynccontextmanager
async def rtsp_client(gateway: RunningGateway, path: str, authorization: str) -> AsyncIterator[RtspClient]:
    """Connect a client for a path."""
    reader, writer = await asyncio.open_connection("127.0.0.1", gateway.port)
    address = f"rtsp://127.0.0.1:{gateway.port}{path}"
    client = RtspClient(reader, writer, address, f"Authorization: {authorization}")
    reading = asyncio.create_task(client.read())
    try:
        yield client
    finally:
        reading.cancel()
        await asyncio.gather(reading, return_exceptions=True)
        writer.close()
