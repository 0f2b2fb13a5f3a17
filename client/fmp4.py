"""Incremental parser of fragmented MP4: boxes, init segment, fragments and their time (ISO/IEC 14496-12)."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from client.media_stream import Fragment, InitSegment, MediaStreamError

MAX_BOX = 64_000_000  # bytes; a fragment of video has some thousand
_HEADER = 8  # bytes: size and kind
_LARGE_HEADER = 16  # bytes: with the size in 64 bits
_SIZE_AND_KIND = struct.Struct(">I4s")
_LARGE = 1  # as the size: the real one follows in 64 bits


@dataclass(frozen=True, slots=True)
class Mp4Box:
    """A box: its four-letter type, all its bytes, and the length of its header."""

    kind: bytes
    data: bytes
    header: int

    @property
    def content(self) -> bytes:
        """The bytes after the header."""
        return self.data[self.header :]


class BoxReader:
    """Splits a stream into its top-level boxes."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, data: bytes) -> Iterator[Mp4Box]:
        """Yield the boxes that ``data`` completes.

        Raises:
            MediaStreamError: a box has an impossible size.
        """
        self._rest += data
        while (box := _first_box(self._rest)) is not None:
            del self._rest[: len(box.data)]
            yield box


class Mp4Reader:
    """Splits the bytes of one connection into the init segment and complete fragments."""

    def __init__(self) -> None:
        self._boxes = BoxReader()
        self._pending = bytearray()  # boxes of the next init segment or fragment
        self._timescale = 0
        self._sound: int | None = None  # the number of the sound track
        self._time: int | None = None
        self._is_sound = False

    def feed(self, data: bytes) -> Iterator[InitSegment | Fragment]:
        """Yield the parts that ``data`` completes.

        Raises:
            MediaStreamError: not a fragmented MP4 with a time in each fragment.
        """
        for box in self._boxes.feed(data):
            if (part := self._part(box)) is not None:
                yield part

    def _part(self, box: Mp4Box) -> InitSegment | Fragment | None:
        self._pending += box.data
        match box.kind:
            case b"moov":
                self._timescale, self._sound = timescale(box), sound_track(box)
                return InitSegment(self._take_pending(), self._timescale)
            case b"moof":
                if not self._timescale:
                    raise MediaStreamError("a fragment before the header")
                self._time = decode_time(box)
                self._is_sound = self._sound is not None and track_of(box) == self._sound
            case b"mdat":
                time, self._time = self._time, None
                if time is None:
                    raise MediaStreamError("media without a fragment header")
                return Fragment(self._take_pending(), time, self._is_sound)
        if len(self._pending) > MAX_BOX:
            raise MediaStreamError("boxes without media")
        return None

    def _take_pending(self) -> bytes:
        data = bytes(self._pending)
        self._pending.clear()
        return data


def timescale(moov: Mp4Box) -> int:
    """Return the units per second of the first track's media time.

    Raises:
        MediaStreamError: the box has no track, or its timescale is 0.
    """
    mdhd = child(moov.content, b"trak", b"mdia", b"mdhd")
    units = _field(mdhd, 12, 20, ">I")  # after the two times, of 32 or 64 bits by version
    if units == 0:
        raise MediaStreamError("the track's timescale is 0")
    return units


def sound_track(moov: Mp4Box) -> int | None:
    """Return the number of the sound track; None without one."""
    for trak in BoxReader().feed(moov.content):
        if trak.kind == b"trak" and _handler(trak.content) == b"soun":
            return _field(child(trak.content, b"tkhd"), 12, 20, ">I")
    return None


def _handler(trak: bytes) -> bytes:
    """Return the handler type of a track: ``vide``, ``soun``, …; empty without one."""
    try:
        return child(trak, b"mdia", b"hdlr")[8:12]
    except MediaStreamError:
        return b""


def track_of(moof: Mp4Box) -> int:
    """Return the number of a fragment's track.

    Raises:
        MediaStreamError: the box that holds it is missing.
    """
    return _field(child(moof.content, b"traf", b"tfhd"), 4, 4, ">I")


def decode_time(moof: Mp4Box) -> int:
    """Return the media time of the fragment's first frame, in units of the timescale.

    Raises:
        MediaStreamError: the box that holds it is missing.
    """
    tfdt = child(moof.content, b"traf", b"tfdt")
    return _field(tfdt, 4, 4, ">Q" if tfdt[:1] == b"\x01" else ">I")


def child(content: bytes, *path: bytes) -> bytes:
    """Return the content of the first box along ``path``.

    Raises:
        MediaStreamError: there is no such box.
    """
    for kind in path:
        content = _child(content, kind)
    return content


def _child(content: bytes, kind: bytes) -> bytes:
    at = 0
    while (head := _head(content, at)) is not None and at + head.size <= len(content):
        if head.kind == kind:
            return content[at + head.length : at + head.size]
        at += head.size
    raise MediaStreamError(f"there is no {kind.decode()} box")


def _field(content: bytes, at_version_0: int, at_version_1: int, code: str) -> int:
    at = at_version_1 if content[:1] == b"\x01" else at_version_0
    try:
        (value,) = struct.unpack_from(code, content, at)
    except struct.error as error:
        raise MediaStreamError("a box is too short") from error
    return int(value)


class _Head(NamedTuple):
    """The header of a box: the size of the whole box, its type, and the length of the header."""

    size: int
    kind: bytes
    length: int


def _head(data: bytes | bytearray, at: int) -> _Head | None:
    """Parse the header of the box at an offset; None if it is incomplete."""
    if len(data) < at + _HEADER:
        return None
    size, kind = _SIZE_AND_KIND.unpack_from(data, at)
    length = _HEADER
    if size == _LARGE:
        length = _LARGE_HEADER
        if len(data) < at + length:
            return None
        (size,) = struct.unpack_from(">Q", data, at + _HEADER)
    if not length <= size <= MAX_BOX:
        raise MediaStreamError(f"a box of {size} bytes")
    return _Head(size, kind, length)


def _first_box(data: bytes | bytearray) -> Mp4Box | None:
    """Return the box at the beginning of the bytes; None if it is incomplete."""
    head = _head(data, 0)
    if head is None or len(data) < head.size:
        return None
    return Mp4Box(head.kind, bytes(data[: head.size]), head.length)
