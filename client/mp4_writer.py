"""From the fragments of a stream to a plain MP4 file: one table of samples, time from 0 (ISO/IEC 14496-12).

Fragments at a stream's own times play in a browser that is told so; a file of them has a seek bar that begins
hours before its first picture. Pictures and sound are copied, not decoded.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from client.fmp4 import (
    MAX_BOX,
    BoxReader,
    Mp4Box,
    Mp4Error,
    child,
    decode_time,
    sound_track,
    timescale,
    track_of,
)
from client.mp4_tables import Film, Samples, box, moov

_HEADER = 8
_NOT_SYNC = 0x00010000
"""sample_is_non_sync_sample (8.8.3.1)."""
_PICTURES = 0x000701
"""trun of the server's pictures: each sample has a duration, a size and flags (8.8.8.1)."""
_SOUND = 0x000201
"""trun of its sound: each sample has a size; how long each lasts is said once, in tfhd."""
_TRUN_HEAD = 12
"""Bytes of it before its entries."""
_ENTRY = struct.Struct(">3I")


def write_plain(fragmented: Path, out: Path) -> None:
    """Write what is in a file of fragments as a plain one. A hole in time stretches the picture before it.

    Raises:
        Mp4Error: the file is not one of MyView's streams.
        OSError: it cannot be read, or ``out`` not written.
    """
    with fragmented.open("rb") as source, out.open("wb") as target:
        try:
            film, media = _scan(source)
            head = box("ftyp", b"isom" + struct.pack(">I", 512) + b"isomiso2avc1mp41")
            size = sum(length for _, length in media)
            moov_bytes = len(moov(film, 0))
            target.write(head + moov(film, len(head) + moov_bytes + 2 * _HEADER))
        except (struct.error, ArithmeticError, IndexError) as error:
            raise Mp4Error("it says times and sizes that no film has") from error
        target.write(struct.pack(">I4sQ", 1, b"mdat", 2 * _HEADER + size))
        for offset, length in media:
            source.seek(offset)
            target.write(source.read(length))


def _scan(file: BinaryIO) -> tuple[Film, list[tuple[int, int]]]:
    """Return what a file holds, and where in it the media are: offset and length."""
    film: Film | None = None
    sound: int | None = None
    samples: Samples | None = None
    media: list[tuple[int, int]] = []
    size = 0
    for kind, offset, length in _top_boxes(file):
        if kind == b"mdat":
            media.append((offset + _HEADER, length - _HEADER))
            size += length - _HEADER
        elif kind in {b"moov", b"moof"}:
            file.seek(offset)
            (found,) = BoxReader().feed(file.read(length))
            if kind == b"moov":
                sound = sound_track(found)
                film = Film(found, Samples(timescale(found)))
                if sound is not None:
                    film.sound = Samples(_sound_rate(found))
            elif film is not None:
                is_sound = film.sound is not None and track_of(found) == sound
                samples = film.sound if is_sound else film.pictures
                assert samples is not None  # noqa: S101 — as is_sound says
                (_take_sound if is_sound else _take_pictures)(samples, found, size)
    if film is None or not film.pictures.sizes:
        raise Mp4Error("there is no media")
    film.end_sound_with_the_pictures()
    return film, media


def _top_boxes(file: BinaryIO) -> Iterator[tuple[bytes, int, int]]:
    offset = 0
    while len(head := file.read(_HEADER)) == _HEADER:
        length, kind = struct.unpack(">I4s", head)
        if not _HEADER <= length <= MAX_BOX:
            raise Mp4Error(f"a box of {length} bytes")
        yield kind, offset, length
        offset += length
        file.seek(offset)


def _sound_rate(found: Mp4Box) -> int:
    traks = [it for it in BoxReader().feed(found.content) if it.kind == b"trak"]
    (rate,) = struct.unpack_from(">I", child(traks[-1].content, b"mdia", b"mdhd"), 12)
    return int(rate)


def _take_pictures(samples: Samples, moof: Mp4Box, at: int) -> None:
    time = decode_time(moof)
    entries = _entries(moof, _PICTURES, _ENTRY.size)
    samples.begin(at, len(entries) // _ENTRY.size)
    for duration, size, flags in _ENTRY.iter_unpack(entries):
        samples.add(size, time, duration)
        if not flags & _NOT_SYNC:
            samples.keys.append(len(samples.sizes))
        time += duration


def _take_sound(samples: Samples, moof: Mp4Box, at: int) -> None:
    time = decode_time(moof)
    tfhd = child(moof.content, b"traf", b"tfhd")
    entries = _entries(moof, _SOUND, 4)
    samples.begin(at, len(entries) // 4)
    for (size,) in struct.iter_unpack(">I", entries):
        samples.add(size, time, duration := int.from_bytes(tfhd[8:12], "big"))
        time += duration


def _entries(moof: Mp4Box, flags: int, each: int) -> bytes:
    trun = child(moof.content, b"traf", b"trun")
    entries = trun[_TRUN_HEAD:]
    if int.from_bytes(trun[1:4], "big") != flags or len(entries) % each:
        raise Mp4Error("its fragments are not those of a MyView server")
    return entries
