"""What a client reads: films in both containers, and events."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from io import BufferedWriter
from pathlib import Path
from random import Random
from typing import ClassVar, Literal

from benchmarks.fuzz.engine.mutations import damaged
from benchmarks.fuzz.engine.target import Target, folder, refused
from benchmarks.fuzz.media.damaged_media import stream, wrong
from client.fmp4 import BoxReader, Mp4Error
from client.mp4_writer import write_plain
from client.recording import Recording
from client.sse_parser import EventStreamError, SseParser
from client.webm import ElementReader, WebmError
from client.webm_recording import WebmRecording, write_indexed


class _Film(Target):
    """A stream that a client reads in pieces, and makes a file of."""

    codec: ClassVar[Literal["h264", "vp8"]]
    error: ClassVar[type[Exception]]

    def __init__(self) -> None:
        self._stream = stream(self.codec)
        self._folder = folder()
        self._path = Path(self._folder.name)

    def make(self, rng: Random) -> bytes:
        """Return a stream."""
        return wrong(rng, self._stream)

    def feed(self, data: bytes) -> bool:
        """Read it in pieces, and record it."""
        part = self._path / "film.part"
        try:
            with part.open("wb") as file:
                self.record((data[at : at + 1500] for at in range(0, len(data), 1500)), file)
        except self.error as error:
            refused(error)
        try:
            self.finish(part)
        except self.error as error:
            return refused(error)
        return True

    @abstractmethod
    def record(self, pieces: Iterable[bytes], file: BufferedWriter) -> None:
        """Write what comes as it comes."""

    @abstractmethod
    def finish(self, part: Path) -> None:
        """Make the file that plays everywhere of it."""

    def close(self) -> None:
        """Take the folder away."""
        self._folder.cleanup()


class ClientMp4(_Film):
    """What `myview watch` is sent, and makes a file of."""

    name = "media-mp4"
    codec = "h264"
    error = Mp4Error

    def record(self, pieces: Iterable[bytes], file: BufferedWriter) -> None:
        """Write what comes as it comes."""
        reader, taken = BoxReader(), Recording(file, 10.0)
        for piece in pieces:
            for box in reader.feed(piece):
                taken.take(box)

    def finish(self, part: Path) -> None:
        """Make the file that plays everywhere of it."""
        write_plain(part, part.with_suffix(".mp4"))


class ClientWebm(_Film):
    """The same of WebM."""

    name = "media-webm"
    codec = "vp8"
    error = WebmError

    def record(self, pieces: Iterable[bytes], file: BufferedWriter) -> None:
        """Write what comes as it comes."""
        reader, taken = ElementReader(), WebmRecording(file, 10.0)
        for piece in pieces:
            for element in reader.feed(piece):
                taken.take(element)

    def finish(self, part: Path) -> None:
        """Make the file that can be looked through of it."""
        write_indexed(part, part.with_suffix(".webm"))


class Events(Target):
    """Server-sent events, as the client reads them."""

    name = "media-events"
    _SENT = b'event: gop\nid: 7\ndata: {"first": 5, "frames": 5}\n\n: hello\r\ndata: a\rdata: b\n\n'

    def make(self, rng: Random) -> bytes:
        """Return a stream of events."""
        return damaged(rng, self._SENT)

    def feed(self, data: bytes) -> bool:
        """Read it in pieces."""
        whole, pieces = SseParser(), SseParser()
        try:
            events = whole.feed(data)
            step = 1 + len(data) % 7
            cut = [it for at in range(0, len(data), step) for it in pieces.feed(data[at : at + step])]
        except EventStreamError as error:
            return refused(error)
        assert cut == events, "how a stream is cut changes what it says"
        return True
