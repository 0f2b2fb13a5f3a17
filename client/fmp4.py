"""Fragmented MP4 as it arrives: whole boxes, and the media time of a fragment (ISO/IEC 14496-12)."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

MAX_BOX = 64_000_000  # bytes; a fragment of video has some thousand
_HEADER = 8  # bytes: size and kind
_LARGE_HEADER = 16  # bytes: with the size in 64 bits
_SIZE_AND_KIND = struct.Struct(">I4s")
_LARGE = 1  # as the size: the real one follows in 64 bits


class Mp4Error(ValueError):
    """The bytes are not a fragmented MP4."""


@dataclass(frozen=True, slots=True)
class Mp4Box:
    """A box: its four letters, all its bytes, and where in them its content begins."""

    kind: bytes
    data: bytes
    header: int

    @property
    def content(self) -> bytes:
        """The bytes after the header."""
        return self.data[self.header :]


class BoxReader:
    """Cuts a stream into its top-level boxes."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, data: bytes) -> Iterator[Mp4Box]:
        """Yield the boxes that ``data`` completes.

        Raises:
            Mp4Error: a size that no box can have.
        """
        self._rest += data
        while (box := _first_box(self._rest)) is not None:
            del self._rest[: len(box.data)]
            yield box


def timescale(moov: Mp4Box) -> int:
    """Return the units per second of the first track's media time.

    Raises:
        Mp4Error: the box has no track, or one without a rate.
    """
    mdhd = child(moov.content, b"trak", b"mdia", b"mdhd")
    units = _field(mdhd, 12, 20, ">I")  # after the two times, of 32 or 64 bits by version
    if units == 0:
        raise Mp4Error("the track's timescale is 0")
    return units


def sound_track(moov: Mp4Box) -> int | None:
    """Return the number of the track of sound; None where there is none."""
    for trak in BoxReader().feed(moov.content):
        if trak.kind == b"trak" and _handler(trak.content) == b"soun":
            return _field(child(trak.content, b"tkhd"), 12, 20, ">I")
    return None


def _handler(trak: bytes) -> bytes:
    """Return what kind of track it is; nothing where it does not say."""
    try:
        return child(trak, b"mdia", b"hdlr")[8:12]
    except Mp4Error:
        return b""


def track_of(moof: Mp4Box) -> int:
    """Return the number of the track that a fragment belongs to.

    Raises:
        Mp4Error: the fragment does not say.
    """
    return _field(child(moof.content, b"traf", b"tfhd"), 4, 4, ">I")


def decode_time(moof: Mp4Box) -> int:
    """Return the media time of the fragment's first frame, in units of the timescale.

    Raises:
        Mp4Error: the fragment does not say.
    """
    tfdt = child(moof.content, b"traf", b"tfdt")
    return _field(tfdt, 4, 4, ">Q" if tfdt[:1] == b"\x01" else ">I")


def child(content: bytes, *path: bytes) -> bytes:
    """Return the content of the first box along ``path``.

    Raises:
        Mp4Error: there is none.
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
    raise Mp4Error(f"there is no {kind.decode()} box")


def _field(content: bytes, at_version_0: int, at_version_1: int, code: str) -> int:
    at = at_version_1 if content[:1] == b"\x01" else at_version_0
    try:
        (value,) = struct.unpack_from(code, content, at)
    except struct.error as error:
        raise Mp4Error("a box is too short") from error
    return int(value)


class _Head(NamedTuple):
    """What a box begins with: how many bytes it has, its four letters, and how long this is itself."""

    size: int
    kind: bytes
    length: int


def _head(data: bytes | bytearray, at: int) -> _Head | None:
    """Read the beginning of the box there; None if that is not whole yet."""
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
        raise Mp4Error(f"a box of {size} bytes")
    return _Head(size, kind, length)


def _first_box(data: bytes | bytearray) -> Mp4Box | None:
    """Return the box that the bytes begin with; None if it is not whole yet."""
    head = _head(data, 0)
    if head is None or len(data) < head.size:
        return None
    return Mp4Box(head.kind, bytes(data[: head.size]), head.length)
