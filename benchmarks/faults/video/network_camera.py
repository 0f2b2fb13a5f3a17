"""A fake network camera with injectable faults: MPEG-TS over HTTP."""

from __future__ import annotations

import asyncio
import contextlib
import io
import random
import time
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
from av.video.stream import VideoStream

from benchmarks.faults.video.stamped_views import FPS, FRAMES

_TIME_BASE = Fraction(1, 90_000)
_GOP = 10
_GARBAGE_BYTES = 4000
_HOUR_S = 3600
_ANSWER = b"HTTP/1.0 200 OK\r\nContent-Type: video/mp2t\r\n\r\n"


@dataclass(frozen=True, slots=True)
class EncodedFilm:
    """Encoded pictures that the camera sends in a loop."""

    path: Path
    pictures: tuple[bytes, ...]

    @classmethod
    def of(cls, path: Path) -> EncodedFilm:
        """Read a film."""
        with av.open(str(path)) as container:
            found = [bytes(packet) for packet in container.demux(video=0) if packet.size]
        return cls(path, tuple(found))


class _Muxer:
    """Muxes pictures of a film into a transport stream."""

    def __init__(self, film: EncodedFilm) -> None:
        self._film, self._out = film, io.BytesIO()
        self._container = av.open(self._out, "w", format="mpegts")
        with av.open(str(film.path)) as template:
            self._stream: VideoStream = self._container.add_stream_from_template(template.streams.video[0])

    def pack(self, number: int, shift_s: int) -> bytes:
        """Return the transport stream packets of a frame."""
        packet = av.Packet(self._film.pictures[number % FRAMES])
        packet.stream, packet.time_base = self._stream, _TIME_BASE
        packet.pts = packet.dts = round((number / FPS + shift_s) / _TIME_BASE)
        packet.is_keyframe = number % _GOP == 0
        self._container.mux(packet)
        data = self._out.getvalue()
        self._out.seek(0)
        self._out.truncate()
        return data


class NetworkCamera:
    """Serves a film in real time to every client. Changed attributes apply from the next frame on."""

    def __init__(self, film: EncodedFilm, port: int) -> None:
        self.film = film
        self.frozen = self.garbage = False
        self.shift_s = 0
        """Offset of the timestamps, seconds."""
        self.began = time.time()
        """Time of frame 0, Unix seconds."""
        self.url = f"http://127.0.0.1:{port}/live.ts"
        self._port = port
        self._server: asyncio.Server | None = None
        self._connections: set[asyncio.StreamWriter] = set()

    async def open(self) -> None:
        """Accept connections."""
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", self._port)

    async def close(self) -> None:
        """Drop all connections, and accept no more."""
        if self._server is not None:
            self._server.close()
        for writer in self._connections:
            writer.transport.abort()

    def jump(self) -> None:
        """Let its timestamps jump by an hour."""
        self.shift_s += _HOUR_S

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._connections.add(writer)
        try:
            with contextlib.suppress(ConnectionError, asyncio.IncompleteReadError):
                await reader.readuntil(b"\r\n\r\n")
                writer.write(_ANSWER)
                await self._send(writer)
        finally:
            self._connections.discard(writer)
            writer.close()

    async def _send(self, writer: asyncio.StreamWriter) -> None:
        noise = random.Random(1)
        muxer: _Muxer | None = None
        state = self._stream_state()
        number = self._current_frame()
        while not writer.is_closing():
            if state != self._stream_state():
                muxer, state, number = None, self._stream_state(), self._current_frame()
            if number > self._current_frame():
                await asyncio.sleep(0.5 / FPS)
                continue
            if self.frozen or self.garbage:
                muxer = None  # afterwards it starts with a keyframe, as a restarted encoder does
            if self.garbage:
                writer.write(noise.randbytes(_GARBAGE_BYTES))
            elif not self.frozen and (muxer is not None or number % _GOP == 0):
                muxer = muxer or _Muxer(self.film)
                writer.write(muxer.pack(number, self.shift_s))
                await writer.drain()
            number += 1  # no frame is skipped: the next ones depend on it

    def _stream_state(self) -> tuple[EncodedFilm, int, float]:
        """Return the state whose change begins a new stream."""
        return self.film, self.shift_s, self.began

    def _current_frame(self) -> int:
        return int((time.time() - self.began) * FPS)
