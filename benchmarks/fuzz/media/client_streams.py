"""Targets for the client: media streams in both containers, and events."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from random import Random
from typing import ClassVar, Literal

from benchmarks.fuzz.engine.mutations import mutate_bytes
from benchmarks.fuzz.engine.target import Target, folder, refused
from benchmarks.fuzz.media.damaged_media import damage_media, stream
from client.media_stream import MediaStreamError
from client.recording import Recording
from client.remux import remux
from client.sse_parser import OverlongEventError, SseParser


class _ClientStream(Target):
    """Target for a stream that the client reads in pieces, records and remuxes."""

    codec: ClassVar[Literal["h264", "vp8"]]
    container: ClassVar[Literal["mp4", "webm"]]

    def __init__(self) -> None:
        self._stream = stream(self.codec)
        self._folder = folder()
        self._path = Path(self._folder.name)

    def make(self, rng: Random) -> bytes:
        """Return a stream."""
        return damage_media(rng, self._stream)

    def feed(self, data: bytes) -> bool:
        """Read the stream in pieces, record it, and remux the recording."""
        part = self._path / "film.part"
        try:
            with part.open("wb") as file:
                write = Recording(file, 10.0, self.container).new_connection_writer()
                for at in range(0, len(data), 1500):
                    deque(write(data[at : at + 1500]), maxlen=0)
        except MediaStreamError as error:
            refused(error)
        try:
            remux(part, self._path / f"film.{self.container}", self.container)
        except MediaStreamError as error:
            return refused(error)
        return True

    def close(self) -> None:
        """Remove the folder."""
        self._folder.cleanup()


class ClientMp4(_ClientStream):
    """MP4, as `myview watch` reads it."""

    name = "media-mp4"
    codec = "h264"
    container = "mp4"


class ClientWebm(_ClientStream):
    """WebM, as `myview watch` reads it."""

    name = "media-webm"
    codec = "vp8"
    container = "webm"


class ClientEvents(Target):
    """Server-sent events, as the client reads them."""

    name = "media-events"
    _SENT = b'event: gop\nid: 7\ndata: {"first": 5, "frames": 5}\n\n: hello\r\ndata: a\rdata: b\n\n'

    def make(self, rng: Random) -> bytes:
        """Return a stream of events."""
        return mutate_bytes(rng, self._SENT)

    def feed(self, data: bytes) -> bool:
        """Read the events in pieces."""
        whole_parser, piecewise_parser = SseParser(), SseParser()
        try:
            events = whole_parser.feed(data)
            step = 1 + len(data) % 7
            piecewise = [
                event
                for at in range(0, len(data), step)
                for event in piecewise_parser.feed(data[at : at + step])
            ]
        except OverlongEventError as error:
            return refused(error)
        assert piecewise == events, "the result depends on the pieces"
        return True
