"""The recording of a stream: whole fragments into a ``.part`` file, which is remuxed at the end."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from client.atomic_writer import AtomicWriter, Sink
from client.fmp4 import Mp4Reader
from client.media_stream import FormatChangedError, Fragment, InitSegment, MediaStreamError
from client.webm import WebmReader

_log = logging.getLogger(__name__)

_READERS: dict[str, type[Mp4Reader | WebmReader]] = {"mp4": Mp4Reader, "webm": WebmReader}


class Recording:
    """Writes the init segment and the fragments of one or more connections; ``out`` None: only counts them.

    The init segment of the first connection is written; later ones must be equal to it.
    """

    def __init__(self, out: Sink | None, seconds: float | None, container: str = "mp4") -> None:
        self._out = out
        self._limit = seconds
        self._init_segment: InitSegment | None = None
        self._timescale = 1
        self._first: int | None = None
        self._last = 0
        self._last_sound = -1
        self.container = container
        self.bytes = 0
        self.fragments = 0

    @property
    def seconds(self) -> float:
        """Media time from the first picture to the beginning of the last."""
        return 0.0 if self._first is None else (self._last - self._first) / self._timescale

    @property
    def begin(self) -> float | None:
        """Media time of the first picture in seconds; None before it."""
        return None if self._first is None else self._first / self._timescale

    @property
    def media_time(self) -> float | None:
        """Media time of the last picture in seconds: pulse / fps; None before the first."""
        return None if self._first is None else self._last / self._timescale

    def new_connection_writer(self) -> Callable[[bytes], Iterator[bool]]:
        """Return a function that writes the bytes of a new connection; it yields the results of `accept`.

        An incomplete part at the end of a connection is dropped.
        """
        reader = _READERS[self.container]()
        return lambda data: map(self.accept, reader.feed(data))

    def accept(self, part: InitSegment | Fragment) -> bool:
        """Write the next part; return False, without writing it, when ``seconds`` are full.

        Raises:
            FormatChangedError: the format has changed.
        """
        if isinstance(part, InitSegment):
            self._accept_init_segment(part)
        elif part.is_sound:
            if part.time > self._last_sound:  # otherwise it is repeated after a reconnection
                self._last_sound = part.time
                self._write(part.data)
        elif self._first is None or part.time > self._last:
            if self._is_full(part.time):
                return False
            self._write(part.data)
            self._first = part.time if self._first is None else self._first
            self._last = part.time
            self.fragments += 1
        return True

    def _is_full(self, time: int) -> bool:
        if self._first is None or self._limit is None:
            return False
        return time - self._first >= self._limit * self._timescale

    def _accept_init_segment(self, init_segment: InitSegment) -> None:
        if self._init_segment is None:
            self._init_segment, self._timescale = init_segment, init_segment.timescale
            self._write(init_segment.data)
        elif init_segment != self._init_segment:
            raise FormatChangedError("the stream has changed its format; the recording ends before it")

    def _write(self, data: bytes) -> None:
        if self._out is not None:
            self._out.write(data)
        self.bytes += len(data)


@contextmanager
def recording(out: Path | None, seconds: float | None, container: str = "mp4") -> Iterator[Recording]:
    """Record into ``out.part``, which is remuxed into ``out`` at the end, also after errors, if it has media.

    An interrupted recording, or one on a full disk, is kept up to its last complete fragment; an empty one
    leaves no file. ``out`` is a progressive MP4 or an indexed WebM; if the disk has no room to write it
    beside ``out.part``, it is the fragments as received.

    Raises:
        OSError: the file cannot be written.
    """
    if out is None:
        yield Recording(None, seconds, container)
        return
    part = out.with_name(out.name + ".part")
    record = None
    try:
        with part.open("wb", buffering=0) as file:
            record = Recording(AtomicWriter(file), seconds, container)
            yield record
    finally:
        if record is not None and record.fragments:
            _finish(part, out, container)
        else:
            part.unlink(missing_ok=True)


def _finish(part: Path, out: Path, container: str) -> None:
    from client.remux import remux  # noqa: PLC0415 — it loads FFmpeg, which the best-view process does not need

    remuxed = out.with_name(out.name + ".remuxed")
    try:
        remux(part, remuxed, container)
    except (OSError, MediaStreamError) as error:
        _log.warning("%s: cannot be remuxed and stays fragmented: %s", out, error)
        remuxed.unlink(missing_ok=True)
        part.replace(out)
    else:
        remuxed.replace(out)
        part.unlink()
