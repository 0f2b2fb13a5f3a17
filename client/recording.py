"""A stream on its way into a file: whole fragments only, and the file appears when it is finished."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from client.atomic_writer import Sink, WholeWriter
from client.fmp4 import MAX_BOX, Mp4Box, Mp4Error, decode_time, sound_track, timescale, track_of
from client.mp4_writer import write_plain
from client.webm import WebmError
from client.webm_recording import WebmRecording, write_indexed

_log = logging.getLogger(__name__)


class StreamChangedError(Mp4Error):
    """The server's stream has another format than the recording began with."""


class Recording:
    """Takes the boxes of one or more connections; ``out`` None: only counts them.

    The header of the first connection serves all; a later one must be equal to it.
    """

    def __init__(self, out: Sink | None, seconds: float | None) -> None:
        self._out = out
        self._limit = seconds
        self._header = b""  # ftyp and moov, as in the file
        self._arriving = b""  # the header of the present connection
        self._timescale = 0
        self._sound: int | None = None  # the track of sound
        self._fragment: list[bytes] = []
        self._waiting = 0  # bytes of it
        self._time: int | None = None
        self._first: int | None = None
        self._last = 0
        self._is_sound = False
        self._last_sound = -1
        self.bytes = 0
        self.fragments = 0

    @property
    def seconds(self) -> float:
        """Media time from the first fragment to the beginning of the last."""
        return 0.0 if self._first is None else (self._last - self._first) / self._timescale

    @property
    def begin(self) -> float | None:
        """Media time of the first fragment in seconds; None before it."""
        return None if self._first is None else self._first / self._timescale

    @property
    def media_time(self) -> float | None:
        """Media time of the last fragment in seconds: pulse / fps; None before the first."""
        return None if self._first is None else self._last / self._timescale

    def reconnected(self) -> None:
        """Begin with a new connection: what was not whole is dropped."""
        self._arriving = b""
        self._drop()
        self._time = None

    def take(self, box: Mp4Box) -> bool:
        """Take the next box; False when ``seconds`` are full: the box is not taken.

        Raises:
            Mp4Error: not a fragmented MP4 with a time in each fragment.
            StreamChangedError: the format has changed.
        """
        match box.kind:
            case b"ftyp":
                self._arriving = box.data
            case b"moov":
                self._take_header(box)
            case b"moof":
                self._time = decode_time(box)
                self._is_sound = self._sound is not None and track_of(box) == self._sound
                if not self._is_sound and self._is_full(self._time):
                    return False
                self._keep(box)
            case b"mdat":
                self._finish_fragment(box.data)
            case _:  # styp, sidx, emsg, or what a later server adds: part of the fragment after it
                self._keep(box)
        return True

    def _keep(self, box: Mp4Box) -> None:
        """Keep a box until its media come."""
        self._fragment.append(box.data)
        self._waiting += len(box.data)
        if self._waiting > MAX_BOX:
            raise Mp4Error("boxes without media")

    def _drop(self) -> None:
        self._fragment = []
        self._waiting = 0

    def _take_header(self, moov: Mp4Box) -> None:
        header = self._arriving + moov.data
        if self._header and header != self._header:
            raise StreamChangedError("the stream has changed its format; the recording ends before it")
        if not self._header:
            self._timescale, self._sound = timescale(moov), sound_track(moov)
            self._header = header
            self._write(header)
        self._drop()

    def _is_full(self, time: int) -> bool:
        if not self._timescale:
            raise Mp4Error("a fragment before the header")
        if self._limit is None:
            return False
        return self._first is not None and time - self._first >= self._limit * self._timescale

    def _finish_fragment(self, mdat: bytes) -> None:
        time, self._time = self._time, None
        if time is None:
            raise Mp4Error("media without a fragment header")
        fragment = b"".join(self._fragment) + mdat
        self._drop()
        if self._is_sound:
            self._take_sound(time, fragment)
            return
        if self._first is not None and time <= self._last:
            return  # sent again after a reconnection
        self._write(fragment)
        self._first = time if self._first is None else self._first
        self._last = time
        self.fragments += 1

    def _take_sound(self, time: int, fragment: bytes) -> None:
        """Write sound, which comes before its pictures, unless it is sent again after a reconnection."""
        if time <= self._last_sound:
            return
        self._last_sound = time
        self._write(fragment)

    def _write(self, data: bytes) -> None:
        if self._out is not None:
            self._out.write(data)
        self.bytes += len(data)


@contextmanager
def recording(
    out: Path | None, seconds: float | None, container: str = "mp4"
) -> Iterator[Recording | WebmRecording]:
    """Record into ``out.part``, which is made into ``out`` at the end, however it ends, if it has any media.

    An interrupted recording is whole up to its last fragment, hence kept, also on a full disk; an empty one
    leaves nothing.
    ``out`` is a plain MP4 file, or a WebM with an index; where the disk has no room for both, it is the
    fragments as they came.

    Raises:
        OSError: the file cannot be written.
    """
    made = WebmRecording if container == "webm" else Recording
    if out is None:
        yield made(None, seconds)
        return
    part = out.with_name(out.name + ".part")
    kept = None
    try:
        with part.open("wb", buffering=0) as file:
            kept = made(WholeWriter(file), seconds)
            yield kept
    finally:
        if kept is not None and kept.fragments:
            _finish(part, out, write_indexed if container == "webm" else write_plain)
        else:
            part.unlink(missing_ok=True)


def _finish(part: Path, out: Path, write: Callable[[Path, Path], None]) -> None:
    plain = out.with_name(out.name + ".plain")
    try:
        write(part, plain)
    except (OSError, Mp4Error, WebmError) as error:
        _log.warning("%s: is left in fragments: %s", out, error)
        plain.unlink(missing_ok=True)
        part.replace(out)
    else:
        plain.replace(out)
        part.unlink()
